import assert from "node:assert/strict";
import { test } from "node:test";
import { Quaternion, Ray, Vector3 } from "three";
import { PullTarget, turned } from "../src/interface/draggeometry.ts";
import { dragKind, LongPress } from "../src/interface/gestures.ts";

const close = (got: Vector3, wanted: readonly [number, number, number]) =>
  assert.ok(got.distanceTo(new Vector3(...wanted)) < 1e-9, `${got.toArray()} is not ${wanted}`);
const ray = (from: [number, number, number], to: [number, number, number]) =>
  new Ray(new Vector3(...from), new Vector3(...to).sub(new Vector3(...from)).normalize());

test("a pull moves in the plane that faces the camera", () => {
  const pull = new PullTarget(new Vector3(0, 0, 1));
  const view = new Vector3(0, 5, 0);
  pull.start("camera", ray([0, -4, 1], [0, 0, 1]), view);
  close(pull.target, [0, 0, 1]);
  pull.move(ray([0, -4, 1], [0.5, 0, 1.5]));
  close(pull.target, [0.5, 0, 1.5]);
});

test("a pull that starts beside the point does not jump, and moves as far as the mouse", () => {
  const pull = new PullTarget(new Vector3(0, 0, 1));
  pull.start("camera", ray([0, -4, 1], [2, 0, 1]), new Vector3(0, 1, 0));
  close(pull.target, [0, 0, 1]);
  pull.move(ray([0, -4, 1], [2.25, 0, 1]));
  close(pull.target, [0.25, 0, 1]);
});

test("a pull in the horizontal plane keeps its height", () => {
  const pull = new PullTarget(new Vector3(0, 0, 1));
  pull.start("horizontal", ray([0, -4, 5], [0, 0, 1]), new Vector3(0, 1, -1));
  pull.move(ray([0, -4, 5], [1, 2, 1]));
  close(pull.target, [1, 2, 1]);
});

test("the plane can change during a pull without a jump", () => {
  const pull = new PullTarget(new Vector3(0, 0, 1));
  pull.start("camera", ray([0, -4, 1], [0, 0, 1]), new Vector3(0, 1, 0));
  pull.move(ray([0, -4, 1], [0, 0, 2]));
  pull.start("horizontal", ray([0, -4, 4], [0, 0, 2]), new Vector3(0, 1, 0));
  close(pull.target, [0, 0, 2]);
  pull.move(ray([0, -4, 4], [0, 1, 2]));
  close(pull.target, [0, 1, 2]);
});

test("a ray along the plane or away from it leaves the target where it is", () => {
  const pull = new PullTarget(new Vector3(0, 0, 1));
  pull.start("horizontal", ray([0, -4, 5], [0, 0, 1]), new Vector3(0, 1, 0));
  pull.move(ray([0, -4, 5], [0, 4, 5.0001]));
  close(pull.target, [0, 0, 1]);
  pull.move(ray([0, -4, 5], [0, 0, 9]));
  close(pull.target, [0, 0, 1]);
});

test("a turn to the right turns about the upward axis of the camera, by half a turn per picture height", () => {
  const camera = new Quaternion();
  close(new Vector3(0, 0, 1).applyQuaternion(turned(new Quaternion(), camera, 0.5, 0)), [1, 0, 0]);
  close(new Vector3(0, 0, 1).applyQuaternion(turned(new Quaternion(), camera, 0, 0.5)), [0, -1, 0]);
  close(new Vector3(0, 0, 1).applyQuaternion(turned(new Quaternion(), camera, 1, 0)), [0, 0, -1]);
});

test("a turn starts from the orientation of the body and follows the camera", () => {
  const start = new Quaternion().setFromAxisAngle(new Vector3(0, 0, 1), 1);
  assert.ok(turned(start, new Quaternion(), 0, 0).angleTo(start) < 1e-9);
  const sideways = new Quaternion().setFromAxisAngle(new Vector3(0, 0, 1), Math.PI / 2);
  close(new Vector3(0, 0, 1).applyQuaternion(turned(new Quaternion(), sideways, 0.5, 0)), [0, 1, 0]);
});

test("gestures are those of simulate, plus Command on a Mac and the modes for touch", () => {
  const plain = { button: 0, ctrlKey: false, metaKey: false };
  assert.equal(dragKind({ ...plain, button: 2, ctrlKey: true }, "off", false), "pull");
  assert.equal(dragKind({ ...plain, ctrlKey: true }, "off", false), "turn");
  assert.equal(dragKind({ ...plain, metaKey: true }, "off", false), "pull");
  assert.equal(dragKind(plain, "off", true), null);
  assert.equal(dragKind(plain, "pull", true), "pull");
  assert.equal(dragKind(plain, "turn", true), "turn");
  assert.equal(dragKind(plain, "pull", false), null);
  assert.equal(dragKind({ ...plain, button: 2 }, "pull", true), null);
});

test("a long press is found if the finger stays, and not if it moves or leaves", async () => {
  const found: string[] = [];
  const press = new LongPress(20, 10);
  const wait = () => new Promise((resolve) => setTimeout(resolve, 60));
  press.start(0, 0, () => found.push("stays"));
  press.move(6, 6);
  await wait();
  press.start(0, 0, () => found.push("moves"));
  press.move(20, 0);
  await wait();
  press.start(0, 0, () => found.push("leaves"));
  press.cancel();
  await wait();
  assert.deepEqual(found, ["stays"]);
});
