import assert from "node:assert/strict";
import { test } from "node:test";
import { AgeMeter, Meter } from "../src/interface/rates.ts";
import { sentence } from "../src/interface/requests.ts";

test("the speed is simulated time per wall time over the last second", () => {
  const meter = new Meter();
  assert.equal(meter.value, null);
  for (let index = 0; index <= 60; index += 1) meter.add(100 + (2 * index) / 60, 5 + index / 60);
  assert.ok(Math.abs(meter.value! - 2) < 1e-9);
  for (let index = 0; index <= 120; index += 1) meter.add(102 + (0.5 * index) / 60, 6 + index / 60);
  assert.ok(Math.abs(meter.value! - 0.5) < 1e-9);
});

test("frames one second apart, as while paused, are enough to measure", () => {
  const meter = new Meter();
  meter.add(3, 10);
  meter.add(3, 11);
  assert.equal(meter.value, 0);
});

test("a server that starts again starts the measurement again, and a repeated frame does not count", () => {
  const meter = new Meter();
  meter.add(50, 10);
  meter.add(50, 10);
  meter.add(51, 11);
  assert.equal(meter.value, 1);
  meter.add(0.5, 12);
  assert.equal(meter.value, null);
});

test("the age is that of the clocks if they agree, and otherwise relative to the fastest frame", () => {
  const same = new AgeMeter();
  assert.ok(Math.abs(same.age(100, 100.03) - 0.03) < 1e-9);
  const other = new AgeMeter();
  assert.ok(Math.abs(other.age(1000, 100.05)) < 1e-9);
  assert.ok(Math.abs(other.age(1001, 101.08) - 0.03) < 1e-9);
});

test("texts of the server become sentences, but names and paths keep their first letter", () => {
  assert.equal(sentence("the simulation is running; pause it first"), "The simulation is running; pause it first.");
  assert.equal(sentence("steps is 0."), "Steps is 0.");
  assert.equal(sentence("'keyframe' is unknown"), "'keyframe' is unknown.");
  assert.equal(sentence("sim.speed must be positive"), "sim.speed must be positive.");
});
