import assert from "node:assert/strict";
import { test } from "node:test";
import { directionOf, driveKey, speedKey } from "../src/drive/keymap.ts";

/** Forward, left and yaw of each key of teleop_twist_keyboard. */
const EXPECTED: Readonly<Record<string, readonly number[]>> = {
  i: [1, 0, 0],
  ",": [-1, 0, 0],
  j: [0, 0, 1],
  l: [0, 0, -1],
  u: [1, 0, 1],
  o: [1, 0, -1],
  m: [-1, 0, -1],
  ".": [-1, 0, 1],
  I: [1, 0, 0],
  "<": [-1, 0, 0],
  J: [0, 1, 0],
  L: [0, -1, 0],
  U: [1, 1, 0],
  O: [1, -1, 0],
  M: [-1, 1, 0],
  ">": [-1, -1, 0],
};

test("the keys are those of teleop_twist_keyboard", () => {
  for (const [key, expected] of Object.entries(EXPECTED)) {
    const shift = key === "<" || key === ">" || key !== key.toLowerCase();
    const { x, y, yaw } = directionOf([driveKey(key)], shift);
    assert.deepEqual([x, y, yaw], expected, key);
  }
});

test("arrows and WASD drive, and k, Space and other keys do not", () => {
  assert.deepEqual(directionOf(["ArrowUp", "ArrowLeft"], false), { x: 1, y: 0, yaw: 1 });
  assert.deepEqual(directionOf(["w", "d"], false), { x: 1, y: 0, yaw: -1 });
  assert.deepEqual(directionOf(["a"], true), { x: 0, y: 1, yaw: 0 });
  for (const key of ["k", " ", "Enter", "F5", "Shift", "toString", "constructor", "__proto__"]) {
    assert.equal(driveKey(key), "", key);
  }
});

test("held keys add up to at most 1, and opposite keys cancel each other", () => {
  assert.deepEqual(directionOf(["i", "u", "w"], false), { x: 1, y: 0, yaw: 1 });
  assert.deepEqual(directionOf(["i", ","], false), { x: 0, y: 0, yaw: 0 });
  assert.deepEqual(directionOf([], false), { x: 0, y: 0, yaw: 0 });
});

test("speed keys change the speeds by a tenth", () => {
  assert.deepEqual(speedKey("q"), [1.1, 1.1]);
  assert.deepEqual(speedKey("c"), [1, 0.9]);
  assert.equal(speedKey("i"), undefined);
  assert.equal(speedKey("constructor"), undefined);
});
