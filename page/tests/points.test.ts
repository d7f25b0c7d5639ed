import assert from "node:assert/strict";
import { test } from "node:test";
import { cloudPoints, type PointCloud2, valueFields } from "../src/topics/cloud.ts";
import { scanPoints } from "../src/topics/scan.ts";

const header = { stamp: { sec: 0, nanosec: 0 }, frame_id: "lidar" };

function near(actual: ArrayLike<number>, expected: number[]): void {
  assert.equal(actual.length, expected.length);
  expected.forEach((value, index) => assert.ok(Math.abs(actual[index]! - value) < 1e-6, `${actual} != ${expected}`));
}

test("each ray of a scan gives the point at its range and angle", () => {
  const points = scanPoints({
    header,
    angle_min: -Math.PI / 2,
    angle_increment: Math.PI / 4,
    range_min: 0.1,
    range_max: 10,
    ranges: new Float32Array([1, 2, 3, 4]),
    intensities: new Float32Array([5, 6, 7, 8]),
  });
  const half = Math.SQRT1_2;
  near(points.positions, [0, -1, 0, 2 * half, -2 * half, 0, 3, 0, 0, 4 * half, 4 * half, 0]);
  near(points.values!, [5, 6, 7, 8]);
});

test("ranges without a distance or outside the limits give no point, and the others keep their angles", () => {
  const ranges = [Infinity, -Infinity, NaN, 0.05, 10.5, -1, 10, 0.1];
  const scan = { header, angle_min: 0, angle_increment: 0.1, range_min: 0.1, range_max: 10, ranges };
  const points = scanPoints({ ...scan, intensities: [] });
  near(points.positions, [10 * Math.cos(0.6), 10 * Math.sin(0.6), 0, 0.1 * Math.cos(0.7), 0.1 * Math.sin(0.7), 0]);
  assert.equal(points.values, null);
  assert.equal(points.total, 8);
  assert.equal(scanPoints({ ...scan, ranges: [], intensities: [] }).positions.length, 0);
});

/** A cloud with padding between points and rows, and fields of several types. */
function cloud(big = false): PointCloud2 {
  const [width, height, step, row] = [2, 2, 24, 56];
  const data = new Uint8Array(height * row + 4).subarray(4);
  const view = new DataView(data.buffer, 4);
  for (let index = 0; index < width * height; index += 1) {
    const at = Math.floor(index / width) * row + (index % width) * step;
    view.setFloat32(at, index, !big);
    view.setFloat32(at + 4, 10 + index, !big);
    view.setFloat64(at + 8, -index, !big);
    view.setUint16(at + 16, 100 * index, !big);
    view.setUint32(at + 20, 0x00102030 + index, !big);
  }
  const fields = [
    { name: "x", offset: 0, datatype: 7, count: 1 },
    { name: "y", offset: 4, datatype: 7, count: 1 },
    { name: "z", offset: 8, datatype: 8, count: 1 },
    { name: "intensity", offset: 16, datatype: 4, count: 1 },
    { name: "rgb", offset: 20, datatype: 7, count: 1 },
  ];
  return { header, height, width, fields, is_bigendian: big, point_step: step, row_step: row, data };
}

for (const big of [false, true]) {
  test(`a cloud is read by the offsets and types of its fields, ${big ? "big" : "little"}-endian`, () => {
    const points = cloudPoints(cloud(big), 1000);
    near(points.positions, [0, 10, 0, 1, 11, -1, 2, 12, -2, 3, 13, -3]);
    near(points.values!, [0, 100, 200, 300]);
    assert.deepEqual([...points.colours!.subarray(0, 6)], [0x10, 0x20, 0x30, 0x10, 0x20, 0x31]);
    assert.deepEqual(valueFields(cloud(big)), ["intensity"]);
  });
}

test("a large cloud is thinned out evenly", () => {
  const points = cloudPoints(cloud(), 2);
  near(points.positions, [0, 10, 0, 2, 12, -2]);
  assert.equal(points.total, 4);
});

test("points without a distance are left out, and their neighbours keep their values", () => {
  const message = cloud();
  new DataView(message.data.buffer, message.data.byteOffset).setFloat32(24, NaN, true);
  const points = cloudPoints(message, 1000);
  near(points.positions, [0, 10, 0, 2, 12, -2, 3, 13, -3]);
  near(points.values!, [0, 200, 300]);
});

test("a cloud whose sizes do not fit is an error and not a crash", () => {
  assert.throws(() => cloudPoints({ ...cloud(), width: 100 }, 10), /112 bytes, which is less than its 200 points need/);
  assert.throws(() => cloudPoints({ ...cloud(), fields: [] }, 10), /no fields x, y and z/);
  const [x, y] = cloud().fields;
  const far = { name: "z", offset: 23, datatype: 7, count: 1 };
  assert.throws(() => cloudPoints({ ...cloud(), fields: [x!, y!, far] }, 10), /field z .* invalid/);
  assert.equal(cloudPoints({ ...cloud(), width: 0, height: 0, data: new Uint8Array(0) }, 10).positions.length, 0);
});
