import assert from "node:assert/strict";
import { test } from "node:test";
import { Matrix4, Quaternion, Vector3 } from "three";
import { compose, interpolate, inverse, pose, type Pose, Transforms } from "../src/topics/transforms.ts";

const HALF = Math.SQRT1_2;
const none = () => null;

function at(x: number, y: number, z: number, yaw = 0): Pose {
  return pose({ x, y, z }, { x: 0, y: 0, z: Math.sin(yaw / 2), w: Math.cos(yaw / 2) });
}

function close(actual: Pose, x: number, y: number, z: number, yaw: number): void {
  const direction = new Vector3(1, 0, 0).applyQuaternion(actual.rotation);
  const numbers = [...actual.position.toArray(), direction.x, direction.y, direction.z];
  [x, y, z, Math.cos(yaw), Math.sin(yaw), 0].forEach((value, index) => {
    assert.ok(Math.abs(numbers[index]! - value) < 1e-9, `${numbers} is not ${[x, y, z, yaw]}`);
  });
}

test("a chain of transforms gives the pose in the world", () => {
  const tree = new Transforms();
  tree.add("world", "base", 1, at(1, 2, 0, Math.PI / 2), false);
  tree.add("base", "mast", 0, at(0.5, 0, 1), true);
  tree.add("mast", "lidar", 0, at(0, 0.2, 0, Math.PI / 2), true);
  const found = tree.find("lidar", 1, "world", none)!;
  // base turns the x axis to y: 0.5 forward is 0.5 in y, 0.2 to the left is -0.2 in x.
  close(found.pose, 0.8, 2.5, 1, Math.PI);
  assert.equal(found.complete, true);
  assert.deepEqual([...tree.frames].sort(), ["base", "lidar", "mast", "world"]);
});

test("compositions and inverses are those of matrices", () => {
  const matrix = ({ position, rotation }: Pose) => new Matrix4().compose(position, rotation, new Vector3(1, 1, 1));
  const one = pose({ x: 1, y: -2, z: 3 }, new Quaternion(0.1, 0.7, -0.3, 0.6));
  const two = pose({ x: -0.5, y: 4, z: 0.25 }, new Quaternion(-0.4, 0.2, 0.5, 0.1));
  const product = matrix(one).multiply(matrix(two)).toArray();
  matrix(compose(one, two))
    .toArray()
    .forEach((value, index) => assert.ok(Math.abs(value - product[index]!) < 1e-12));
  const unit = matrix(compose(one, inverse(one))).toArray();
  new Matrix4().toArray().forEach((value, index) => assert.ok(Math.abs(value - unit[index]!) < 1e-12));
});

test("between two transforms the pose is interpolated, and outside it is the nearest", () => {
  const times = [1, 2, 4];
  const poses = [at(0, 0, 0), at(1, 0, 0, Math.PI / 2), at(1, 2, 0, Math.PI / 2)];
  close(interpolate(times, poses, 1.5), 0.5, 0, 0, Math.PI / 4);
  close(interpolate(times, poses, 3), 1, 1, 0, Math.PI / 2);
  close(interpolate(times, poses, 2), 1, 0, 0, Math.PI / 2);
  close(interpolate(times, poses, 0), 0, 0, 0, 0);
  close(interpolate(times, poses, 9), 1, 2, 0, Math.PI / 2);
});

test("a stamp after the newest transform gives a pose that may still change", () => {
  const tree = new Transforms();
  tree.add("world", "base", 1, at(0, 0, 0), false);
  tree.add("world", "base", 2, at(2, 0, 0), false);
  assert.equal(tree.find("base", 2.5, "world", none)!.complete, false);
  tree.add("world", "base", 3, at(4, 0, 0), false);
  const later = tree.find("base", 2.5, "world", none)!;
  assert.equal(later.complete, true);
  close(later.pose, 3, 0, 0, 0);
});

test("a frame that does not lead to the world is found through the nearest body, up or down the tree", () => {
  const tree = new Transforms();
  tree.add("odom", "base_link", 1, at(1, 0, 0, Math.PI / 2), false);
  tree.add("base_link", "lidar", 0, at(0.5, 0, 0), true);
  const bodies = (name: string) => (name === "base_link" ? { pose: at(3, 3, 0, Math.PI), complete: true } : null);
  close(tree.find("lidar", 1, "world", bodies)!.pose, 2.5, 3, 0, Math.PI);
  // odom is where base_link is (1, 0) and turned by 90 degrees from it.
  close(tree.find("odom", 1, "world", bodies)!.pose, 3, 2, 0, Math.PI / 2);
  close(tree.find("base_link", 1, "world", bodies)!.pose, 3, 3, 0, Math.PI);
});

test("an unknown frame has no pose, and a loop of frames ends", () => {
  const tree = new Transforms();
  assert.equal(tree.find("lidar", 1, "world", none), null);
  tree.add("a", "b", 1, at(1, 0, 0), false);
  tree.add("b", "a", 1, at(1, 0, 0), false);
  assert.equal(tree.find("a", 1, "world", none), null);
  tree.add("c", "c", 1, at(1, 0, 0), false);
  assert.equal(tree.find("c", 1, "world", none), null);
});

test("an earlier time by far replaces the history; a slightly late transform is ignored", () => {
  const tree = new Transforms();
  tree.add("world", "base", 100, at(1, 0, 0), false);
  tree.add("world", "base", 99.9, at(7, 0, 0), false);
  close(tree.find("base", null, "world", none)!.pose, 1, 0, 0, 0);
  tree.add("world", "base", 0.5, at(2, 0, 0), false);
  close(tree.find("base", 200, "world", none)!.pose, 2, 0, 0, 0);
});

test("the history is bounded", () => {
  const tree = new Transforms();
  for (let step = 0; step < 5000; step += 1) tree.add("world", "base", 0.01 * step, at(step, 0, 0), false);
  close(tree.local("base", 0)!.pose, tree.local("base", 0)!.pose.position.x, 0, 0, 0);
  assert.ok(tree.local("base", 0)!.pose.position.x > 5000 - 1200);
  close(tree.local("base", 45)!.pose, 4500, 0, 0, 0);
});

test("a quaternion of zeros is no rotation, and others are normalized", () => {
  close(pose({ x: 0, y: 0, z: 0 }, { x: 0, y: 0, z: 0, w: 0 }), 0, 0, 0, 0);
  close(pose({ x: 0, y: 0, z: 0 }, { x: 0, y: 0, z: 5 * HALF, w: 5 * HALF }), 0, 0, 0, Math.PI / 2);
});
