import assert from "node:assert/strict";
import { test } from "node:test";
import { Box3, InstancedMesh, Mesh, type Object3D, Vector3 } from "three";
import { type Marker, markerShape } from "../src/topics/displays/marker.ts";
import { strip } from "../src/topics/displays/lines.ts";

const ZERO = { x: 0, y: 0, z: 0 };
const WHITE = { r: 1, g: 1, b: 1, a: 1 };

function marker(changes: Partial<Marker>): Marker {
  return {
    header: { stamp: { sec: 0, nanosec: 0 }, frame_id: "box" },
    ns: "",
    id: 0,
    type: 0,
    action: 0,
    pose: { position: ZERO, orientation: { ...ZERO, w: 1 } },
    scale: { x: 1, y: 1, z: 1 },
    color: WHITE,
    lifetime: { sec: 0, nanosec: 0 },
    frame_locked: false,
    points: [],
    colors: [],
    text: "",
    ...changes,
  };
}

function box(object: Object3D): number[] {
  object.updateMatrixWorld(true);
  const { min, max } = new Box3().setFromObject(object, true);
  return [...min, ...max].map((value) => Math.round(1e4 * value) / 1e4 + 0);
}

test("an arrow with two points goes from the first to the second, with the diameters of the scale", () => {
  const points = [
    { x: 1, y: 0, z: 0 },
    { x: 1, y: 0, z: 2 },
  ];
  const shape = markerShape(marker({ points, scale: { x: 0.1, y: 0.4, z: 0.5 } }));
  assert.deepEqual(box(shape), [0.8, -0.2, 0, 1.2, 0.2, 2]);
});

test("an arrow with a pose has its length along x, and the pose turns it", () => {
  const scale = { x: 2, y: 0.2, z: 0.2 };
  assert.deepEqual(box(markerShape(marker({ scale }))), [0, -0.1, -0.1, 2, 0.1, 0.1]);
  const half = Math.SQRT1_2;
  const pose = { position: { x: 5, y: 0, z: 0 }, orientation: { x: 0, y: 0, z: half, w: half } };
  assert.deepEqual(box(markerShape(marker({ scale, pose }))), [4.9, 0, -0.1, 5.1, 2, 0.1]);
});

test("an arrow between equal points is drawn without an error", () => {
  const shape = markerShape(marker({ points: [ZERO, ZERO], scale: { x: 0.1, y: 0.2, z: 0 } }));
  for (const value of box(shape)) assert.ok(Number.isFinite(value));
});

for (const [type, name] of [
  [1, "cube"],
  [2, "sphere"],
  [3, "cylinder"],
] as const) {
  test(`a ${name} has the size of the scale`, () => {
    assert.deepEqual(box(markerShape(marker({ type, scale: { x: 1, y: 2, z: 4 } }))), [-0.5, -1, -2, 0.5, 1, 2]);
  });
}

test("a list has one shape for each point, with its own colour", () => {
  const points = [ZERO, { x: 3, y: 0, z: 0 }];
  const colors = [WHITE, { r: 1, g: 0, b: 0, a: 1 }];
  const shape = markerShape(marker({ type: 6, points, colors, scale: { x: 1, y: 1, z: 1 } }));
  let found: InstancedMesh | undefined;
  shape.traverse((object) => object instanceof InstancedMesh && (found = object));
  assert.equal(found!.count, 2);
  assert.deepEqual([...found!.instanceColor!.array], [1, 1, 1, 1, 0, 0]);
  assert.deepEqual(box(shape), [-0.5, -0.5, -0.5, 3.5, 0.5, 0.5]);
});

test("triangles use three points each and leave out the rest", () => {
  const at = (x: number, y: number) => ({ x, y, z: 0 });
  const shape = markerShape(marker({ type: 11, points: [at(0, 0), at(1, 0), at(0, 1), at(9, 9)] }));
  let found: Mesh | undefined;
  shape.traverse((object) => object instanceof Mesh && (found = object));
  assert.equal(found!.geometry.getAttribute("position").count, 3);
});

test("a type that cannot be drawn is named", () => {
  assert.throws(() => markerShape(marker({ type: 10 })), /Markers of type mesh are not shown/);
  assert.throws(() => markerShape(marker({ type: 99 })), /Markers of type 99 are not shown/);
});

test("a line through points has a segment between each two of them", () => {
  assert.deepEqual([...strip([0, 0, 0, 1, 0, 0, 1, 2, 0])], [0, 0, 0, 1, 0, 0, 1, 0, 0, 1, 2, 0]);
  assert.deepEqual([...strip([0, 0, 0])], []);
  assert.deepEqual([...strip([])], []);
  assert.ok(new Vector3().fromArray(strip([1, 2, 3, 4, 5, 6]), 3).equals(new Vector3(4, 5, 6)));
});
