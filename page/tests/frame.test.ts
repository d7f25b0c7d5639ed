import assert from "node:assert/strict";
import { test } from "node:test";
import { readFrame } from "../src/scene/frame.ts";

test("a frame contains the poses in the order of the wire", () => {
  const view = new DataView(new ArrayBuffer(16 + 36 + 4 * (14 + 12 + 3)), 16);
  view.setFloat64(0, 1.5, true);
  view.setFloat64(8, 1e9, true);
  view.setUint32(16, 3, true);
  view.setUint32(20, 750, true);
  view.setUint16(24, 1, true);
  view.setUint16(26, 2, true);
  view.setUint16(28, 1, true);
  view.setUint32(32, 1, true);
  for (let index = 0; index < 29; index += 1) view.setFloat32(36 + 4 * index, index, true);
  const frame = readFrame(view);
  assert.deepEqual([frame.time, frame.wallTime, frame.epoch, frame.step, frame.paused], [1.5, 1e9, 3, 750, true]);
  assert.deepEqual([...frame.bodies], [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13]);
  assert.deepEqual([...frame.cameras], [14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25]);
  assert.deepEqual([...frame.vertices], [26, 27, 28]);
});
