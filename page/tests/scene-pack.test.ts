import assert from "node:assert/strict";
import { test } from "node:test";
import { isSoftware, pixelRatio } from "../src/scene/graphics.ts";
import { readShapes } from "../src/scene/overlay.ts";
import { Pack } from "../src/scene/pack.ts";

function pack(magic: string, header: object, buffers: Uint8Array): ArrayBuffer {
  const text = new TextEncoder().encode(JSON.stringify(header));
  const start = 8 + text.length + (-(8 + text.length) & 7);
  const bytes = new Uint8Array(start + buffers.length);
  bytes.set(new TextEncoder().encode(magic));
  new DataView(bytes.buffer).setUint32(4, text.length, true);
  bytes.set(text, 8);
  bytes.set(buffers, start);
  return bytes.buffer;
}

test("a pack contains arrays and files at multiples of 8 bytes", () => {
  const buffers = new Uint8Array(32);
  new Float32Array(buffers.buffer, 8, 2).set([1.5, -2]);
  buffers.set([7, 8, 9], 24);
  for (const name of ["a", "ab", "abc", "abcd", "abcde"]) {
    const read = new Pack(pack("MJV1", { name }, buffers));
    assert.equal(read.header.name, name);
    assert.deepEqual([...read.array({ offset: 8, type: "f4", shape: [1, 2] })], [1.5, -2]);
    assert.deepEqual([...read.file({ offset: 24, size: 3 })], [7, 8, 9]);
  }
});

test("something else than a pack is refused with a sentence", () => {
  assert.throws(() => new Pack(pack("<htm", {}, new Uint8Array(0))), /starts with "<htm" instead of "MJV1"/);
  assert.throws(() => new Pack(new ArrayBuffer(0)));
});

test("shapes of an overlay have the values of the wire", () => {
  const view = new DataView(new ArrayBuffer(16 + 2 * 68));
  view.setUint32(12, 2, true);
  for (let field = 0; field < 15; field += 1) view.setFloat32(16 + 68 + 4 * field, field, true);
  view.setUint8(16 + 68 + 63, 255);
  view.setUint32(16 + 68 + 64, 100, true);
  const [first, second] = readShapes(view);
  assert.equal(first!.type, 0);
  assert.equal(second!.type, 100);
  assert.deepEqual([...second!.size], [12, 13, 14]);
  assert.deepEqual([...second!.rgba], [0, 0, 0, 1]);
  // prettier-ignore
  assert.deepEqual(second!.pose.clone().transpose().elements, [3, 4, 5, 0, 6, 7, 8, 1, 9, 10, 11, 2, 0, 0, 0, 1]);
});

test("renderers without a graphics card are recognised", () => {
  assert.ok(isSoftware("ANGLE (Google, Vulkan 1.3.0 (SwiftShader Device (Subzero)), SwiftShader driver)"));
  assert.ok(isSoftware("llvmpipe (LLVM 15.0.6, 256 bits)"));
  assert.equal(isSoftware("ANGLE (NVIDIA, NVIDIA GeForce RTX 4070, OpenGL 4.6)"), false);
});

test("the number of pixels is bounded", () => {
  assert.equal(pixelRatio(800, 600, 1.5, false), 1.5);
  assert.equal(pixelRatio(800, 600, 3, false), 2);
  assert.equal(pixelRatio(800, 600, 2, true), 1);
  assert.ok(pixelRatio(3840, 2160, 2, false) ** 2 * 3840 * 2160 <= 9.01e6);
});
