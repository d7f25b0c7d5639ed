import assert from "node:assert/strict";
import { test } from "node:test";
import {
  count,
  fixed,
  formatAge,
  formatMass,
  formatQuantity,
  formatSpeed,
  formatTime,
  rollPitchYaw,
} from "../src/interface/format.ts";

test("a number that rounds to zero has no sign, and others have a minus as wide as a digit", () => {
  assert.equal(fixed(-0.0004, 3), "0.000");
  assert.equal(fixed(-0.0006, 3), "−0.001");
  assert.equal(fixed(Number.NaN, 3), "–");
});

test("simulated time keeps its three decimals", () => {
  assert.deepEqual([0, 12.3456, 1e5].map(formatTime), ["0.000 s", "12.346 s", "100000.000 s"]);
});

test("speeds are multiples of real time", () => {
  assert.deepEqual([0.1, 1, 9.87, 12.34, 123.4, "max" as const, null].map(formatSpeed), [
    "0.10×",
    "1.00×",
    "9.87×",
    "12.3×",
    "123×",
    "max",
    "–",
  ]);
});

test("ages change their unit before their number becomes long", () => {
  assert.deepEqual([-0.1, 0.0121, 0.9994, 0.9996, 59.94, 59.96, 3500, 7200].map(formatAge), [
    "0 ms",
    "12 ms",
    "999 ms",
    "1.0 s",
    "59.9 s",
    "1 min",
    "58 min",
    "2.0 h",
  ]);
});

test("quantities have three digits and a prefix, also where rounding carries", () => {
  assert.deepEqual(
    [0, 221.4, 999.94, 999.96, 1234, 0.5, 0.0123, -3, 2.5e-7].map((value) => formatQuantity(value, "N")),
    ["0 N", "221 N", "1.00 kN", "1.00 kN", "1.23 kN", "500 mN", "12.3 mN", "−3.00 N", "0.250 µN"],
  );
  assert.equal(formatQuantity(Infinity, "N"), "– N");
});

test("masses use grams, kilograms and tonnes", () => {
  assert.deepEqual([0, 0.012, 8, 1500].map(formatMass), ["0 g", "12.0 g", "8.00 kg", "1.50 t"]);
});

test("counts agree with their noun", () => {
  assert.deepEqual([count(1, "joint"), count(0, "joint")], ["1 joint", "0 joints"]);
});

test("roll, pitch and yaw are those of a quaternion, also when it points straight up", () => {
  const half = Math.SQRT1_2;
  const close = (got: readonly number[], wanted: readonly number[]) =>
    got.forEach((value, index) => assert.ok(Math.abs(value - wanted[index]!) < 1e-7, `${got} is not ${wanted}`));
  close(rollPitchYaw([1, 0, 0, 0]), [0, 0, 0]);
  close(rollPitchYaw([half, half, 0, 0]), [Math.PI / 2, 0, 0]);
  close(rollPitchYaw([half, 0, 0, half]), [0, 0, Math.PI / 2]);
  close([rollPitchYaw([half, 0, half, 0])[1]], [Math.PI / 2]);
});
