import assert from "node:assert/strict";
import { test } from "node:test";
import { fieldReader, listFields } from "../src/topics/plots/fields.ts";
import { merge, Series, toCsv } from "../src/topics/plots/series.ts";
import { unitOf } from "../src/topics/plots/units.ts";

const joints = {
  header: { stamp: { sec: 3, nanosec: 500000000 }, frame_id: "" },
  name: ["shoulder", "elbow"],
  position: new Float64Array([0.5, -1.5]),
  velocity: [],
  effort: new Float64Array([7, 8]),
};

test("the numbers of a message are listed with names where the message contains names", () => {
  assert.deepEqual(listFields(joints), [
    { path: "header.stamp.sec", value: 3 },
    { path: "header.stamp.nanosec", value: 500000000 },
    { path: "position[shoulder]", value: 0.5 },
    { path: "position[elbow]", value: -1.5 },
    { path: "effort[shoulder]", value: 7 },
    { path: "effort[elbow]", value: 8 },
  ]);
  const bodies = {
    free_joints: [
      { name: "box", pose: { x: 1n } },
      { name: "ball", pose: { x: true } },
    ],
  };
  assert.deepEqual(listFields(bodies), [
    { path: "free_joints[box].pose.x", value: 1 },
    { path: "free_joints[ball].pose.x", value: 1 },
  ]);
});

test("names that repeat or look like an index are not used", () => {
  const path = (name: string[]) => listFields({ name, position: [1, 2] }).map((field) => field.path);
  assert.deepEqual(path(["a", "a"]), ["position[0]", "position[1]"]);
  assert.deepEqual(path(["0", "1"]), ["position[0]", "position[1]"]);
  assert.deepEqual(path(["a"]), ["position[0]", "position[1]"]);
  assert.deepEqual(path(["a]", "b"]), ["position[0]", "position[1]"]);
});

test("every listed field is read by its path", () => {
  for (const message of [joints, { data: 4 }, { a: [{ b: [[1, 2]] }] }]) {
    for (const { path, value } of listFields(message)) assert.equal(fieldReader(path)(message), value, path);
  }
});

test("a name finds its value after the order has changed, and a missing one finds nothing", () => {
  const read = fieldReader("position[elbow]");
  assert.equal(read({ name: ["elbow", "wrist"], position: [2, 3] }), 2);
  assert.equal(read({ name: ["wrist"], position: [3] }), undefined);
  assert.equal(fieldReader("position[5]")(joints), undefined);
  assert.equal(fieldReader("no.such.field")(joints), undefined);
  assert.equal(fieldReader("name")(joints), undefined);
});

test("malformed paths are errors", () => {
  for (const path of ["", "a..b", "a[", "[0]", "a b", "1x", "a]", "."])
    assert.throws(() => fieldReader(path), Error, path);
});

test("long arrays and deep messages are listed in part", () => {
  assert.equal(listFields({ ranges: new Float32Array(5000) }).length, 64);
  assert.equal(listFields({ ranges: new Float32Array(5000) }, 10).length, 10);
});

test("a series keeps the newest samples", () => {
  const series = new Series(3);
  for (let index = 0; index < 100; index += 1) {
    series.add(0.1 * index, index);
    assert.deepEqual(
      [...series.values],
      [index - 2, index - 1, index].filter((value) => value >= 0),
    );
  }
  assert.deepEqual([...series.times], [0.1 * 97, 0.1 * 98, 0.1 * 99]);
});

test("lost samples are counted and leave a gap; an earlier time starts again", () => {
  const series = new Series();
  series.add(1, 10, 5);
  series.add(2, 20, 3);
  assert.equal(series.lost, 8);
  assert.deepEqual([...series.times], [1, 1.5, 2]);
  assert.ok(Number.isNaN(series.values[1]));
  series.add(0.5, 1);
  assert.deepEqual([...series.times], [0.5]);
});

test("series of several topics share the times, gaps stay gaps, and absent samples are none", () => {
  const one = { times: new Float64Array([1, 2, 3]), values: new Float64Array([10, NaN, 30]) };
  const two = { times: new Float64Array([0.5, 2, 2, 4]), values: new Float64Array([5, 6, 7, 8]) };
  assert.deepEqual(merge([one, two]), {
    times: [0.5, 1, 2, 3, 4],
    values: [
      [undefined, 10, null, 30, undefined],
      [5, undefined, 7, undefined, 8],
    ],
  });
  assert.deepEqual(merge([one, two], 2.5).times, [3, 4]);
  assert.deepEqual(merge([], 0).times, []);
});

test("the CSV contains every sample at its time", () => {
  const one = { times: new Float64Array([0.1 + 0.2, 1]), values: new Float64Array([-1.5, NaN]) };
  const two = { times: new Float64Array([2]), values: new Float64Array([1e-9]) };
  const csv = toCsv(['/a position["x"]', "/b data, raw"], merge([one, two]));
  assert.equal(csv, 'time [s],"/a position[""x""]","/b data, raw"\r\n0.3,-1.5,\r\n2,,1e-9\r\n');
});

test("units are those of ROS", () => {
  assert.equal(unitOf("sensor_msgs/msg/Imu", "angular_velocity.z"), "rad/s");
  assert.equal(unitOf("nav_msgs/msg/Odometry", "pose.pose.position.x"), "m");
  assert.equal(unitOf("nav_msgs/msg/Odometry", "twist.twist.linear.x"), "m/s");
  assert.equal(unitOf("geometry_msgs/msg/Twist", "angular.z"), "rad/s");
  assert.equal(unitOf("geometry_msgs/msg/WrenchStamped", "wrench.torque.z"), "N·m");
  assert.equal(unitOf("std_msgs/msg/Float64", "data"), "");
});
