import assert from "node:assert/strict";
import { test } from "node:test";
import { gzipSync } from "node:zlib";
import { inflate, lastBefore, split } from "../src/recording/chunks.ts";
import { formatClock } from "../src/recording/player.ts";
import { Recording } from "../src/recording/recording.ts";
import type { Info } from "../src/wire/protocol.ts";

/** An item as mjplug/view/recording.py writes it. */
function item(kind: number, time: number, content: Uint8Array): Uint8Array {
  const bytes = new Uint8Array(16 + content.length + (-content.length & 7));
  const view = new DataView(bytes.buffer);
  view.setUint32(0, kind, true);
  view.setUint32(4, content.length, true);
  view.setFloat64(8, time, true);
  bytes.set(content, 16);
  return bytes;
}

const info = (speed: number) => new TextEncoder().encode(JSON.stringify({ scene: "abc", speed }));
const frame = (number: number) => new Uint8Array([number, 0, 0]);

/** A chunk of the document; `cut` shortens its text. */
function chunk(items: Uint8Array[], from: number, to: number, cut = 0) {
  const text = gzipSync(Buffer.concat(items)).toString("base64");
  const dataset = { mjplug: "items", size: `${text.length}`, from: `${from}`, to: `${to}` };
  return { dataset, textContent: text.slice(0, text.length - cut) };
}

/** A recording from 100 s to 103 s with one frame per second, number 0 to 3; the speed changes at 102 s. */
function recording(cut = 0): Recording {
  const pack = gzipSync("MJV1").toString("base64");
  const scene = { dataset: { mjplug: "scene", size: `${pack.length}`, hash: "abc" }, textContent: pack };
  const chunks = [
    scene,
    chunk([item(0, 100, info(1)), item(1, 100, frame(0)), item(1, 101, frame(1))], 100, 101),
    chunk(
      [item(0, 100, info(1)), item(1, 102, frame(2)), item(0, 102, info(2)), item(1, 103, frame(3))],
      102,
      103,
      cut,
    ),
  ];
  const document = { querySelectorAll: () => chunks } as unknown as Document;
  return new Recording('{"server":"/lab/sim"}', document);
}

/** Notes what a recording delivers. */
function watch(source: Recording): { frames: number[]; speeds: unknown[] } {
  const frames: number[] = [];
  const speeds: unknown[] = [];
  source.listen({
    onFrame: (_, payload) => frames.push(payload.getUint8(0)),
    onInfo: (_, { speed }: Info) => speeds.push(speed),
  });
  return { frames, speeds };
}

test("items are taken apart as documented", async () => {
  const text = gzipSync(Buffer.concat([item(0, 1.5, info(1)), item(1, 2.5, frame(7))])).toString("base64");
  const { infos, frames } = split(await inflate(text));
  assert.deepEqual([infos.length, infos[0]!.time, frames.length, frames[0]!.time], [1, 1.5, 1, 2.5]);
  assert.equal(frames[0]!.payload.getUint8(0), 7);
  assert.equal(frames[0]!.payload.byteLength, 3);
  assert.equal(frames[0]!.payload.byteOffset % 8, 0);
});

test("the last entry that is not later is found", () => {
  const entries = [1, 2, 2, 5].map((time) => ({ time }));
  assert.deepEqual(
    [0, 1, 1.9, 2, 4.9, 5, 9].map((time) => lastBefore(entries, time)),
    [0, 0, 0, 2, 2, 3, 3],
  );
  assert.equal(lastBefore([], 1), 0);
});

test("a recording delivers information before the first frame, and each frame once", async () => {
  const source = recording();
  const { frames, speeds } = watch(source);
  assert.deepEqual([source.duration, source.servers[0]!.name, source.state.connected], [3, "/lab/sim", true]);
  source.watch(0, true);
  await source.seek(0);
  assert.deepEqual([frames, speeds], [[0], [1]]);
  for (let step = 0; step < 32; step++) {
    await source.advance(0.1);
  }
  assert.deepEqual(
    [frames, speeds],
    [
      [0, 1, 2, 3],
      [1, 2],
    ],
  );
  assert.equal(source.position, 3);
  await source.advance(0.1);
  assert.equal(source.playing, false);
});

test("the user can go to any position, back too, and by single frames", async () => {
  const source = recording();
  const { frames, speeds } = watch(source);
  source.playing = false;
  await source.seek(99);
  await source.seek(1.2);
  await source.seek(-5);
  assert.deepEqual(frames, [3, 1, 0]);
  assert.deepEqual(speeds, [2, 1]);
  for (const direction of [1, 1, 1, 1, -1] as const) {
    await source.step(direction);
  }
  assert.deepEqual(frames.slice(3), [1, 2, 3, 2]);
});

test("a recording whose end was not written plays up to there", async () => {
  const source = recording(5);
  const { frames } = watch(source);
  assert.equal(source.duration, 1);
  await source.seek(1);
  assert.deepEqual(frames, [1]);
});

test("the model comes from the recording, and another one is refused with a sentence", async () => {
  const source = recording();
  assert.equal(new TextDecoder().decode(await source.scene("abc")), "MJV1");
  await assert.rejects(source.scene("def"), /does not contain the model/);
  await assert.rejects(source.call(), /This is a recording/);
});

test("an empty recording says so", () => {
  const source = new Recording('{"server":"/sim"}', { querySelectorAll: () => [] } as unknown as Document);
  assert.deepEqual([source.state.connected, source.playing], [false, false]);
  assert.match(source.state.text, /contains no frames/);
});

test("positions are minutes, seconds and tenths", () => {
  assert.deepEqual([0, 9.96, 59.97, 61.25].map(formatClock), ["0:00.0", "0:10.0", "1:00.0", "1:01.3"]);
});
