import assert from "node:assert/strict";
import { test } from "node:test";
import type { Frame } from "../src/scene/frame.ts";
import { Motion, mixPoses } from "../src/scene/motion.ts";

function frame(x: number, time: number, more: Partial<Frame> = {}): Frame {
  return {
    time,
    wallTime: 1000 + time,
    epoch: 0,
    step: Math.round(1000 * time),
    paused: false,
    bodies: new Float32Array([x, 0, 0, 1, 0, 0, 0]),
    cameras: new Float32Array(0),
    vertices: new Float32Array([x, x, x]),
    ...more,
  };
}

function shown(motion: Motion, now: number): number {
  motion.advance(now);
  return motion.bodies[0]!;
}

test("poses move from the last frame to the newest in the time between them", () => {
  const motion = new Motion();
  motion.push(frame(0, 0), 10, true);
  assert.equal(shown(motion, 10), 0);
  motion.push(frame(1, 0.02), 10.02, true);
  assert.ok(Math.abs(shown(motion, 10.025) - 0.25) < 1e-6);
  assert.ok(Math.abs(motion.vertices[2]! - 0.25) < 1e-6);
  assert.ok(motion.moving);
  assert.equal(shown(motion, 10.05), 1);
  assert.equal(motion.moving, false);
  assert.equal(motion.advance(10.06), false);
});

test("a frame that arrives on the way starts from what is shown", () => {
  const motion = new Motion();
  motion.push(frame(0, 0), 10, true);
  shown(motion, 10);
  motion.push(frame(1, 0.02), 10.02, true);
  assert.ok(Math.abs(shown(motion, 10.03) - 0.5) < 1e-6);
  motion.push(frame(2, 0.04), 10.03, true);
  assert.ok(Math.abs(shown(motion, 10.03) - 0.5) < 1e-6);
  assert.ok(Math.abs(shown(motion, 10.04) - 1.25) < 1e-6);
});

const JUMPS: [string, Partial<Frame>, boolean][] = [
  ["after a reset", { epoch: 1 }, true],
  ["if the simulated time does not advance", { time: 0 }, true],
  ["after a pause of the frames", { wallTime: 2000 }, true],
  ["if the page draws no picture in between", {}, false],
  ["if the number of vertices differs", { vertices: new Float32Array(6) }, true],
];
for (const [when, difference, smooth] of JUMPS) {
  test(`poses jump ${when}`, () => {
    const motion = new Motion();
    motion.push(frame(0, 0), 10, true);
    shown(motion, 10);
    motion.push(frame(1, 0.02, difference), 10.02, smooth);
    assert.equal(shown(motion, 10.021), 1);
    assert.equal(motion.moving, false);
  });
}

test("orientations turn along the shorter way and keep their length", () => {
  const half = Math.SQRT1_2;
  const mixed = mixPoses(
    new Float32Array([0, 0, 0, 1, 0, 0, 0]),
    // The same as a rotation by 90 degrees about z.
    new Float32Array([0, 0, 0, -half, 0, 0, -half]),
    0.5,
  );
  const angle = 2 * Math.atan2(Math.abs(mixed[6]!), Math.abs(mixed[3]!));
  assert.ok(Math.abs(angle - Math.PI / 4) < 1e-6);
  assert.ok(Math.abs(Math.hypot(...mixed.slice(3)) - 1) < 1e-6);
});

test("frames that arrive before anything is shown jump to the newest", () => {
  const motion = new Motion();
  motion.push(frame(0, 0), 10, true);
  motion.push(frame(1, 0.02), 10.02, true);
  assert.equal(shown(motion, 10.025), 1);
  assert.equal(motion.moving, false);
});
