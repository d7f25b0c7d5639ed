import assert from "node:assert/strict";
import { test } from "node:test";
import { PerspectiveCamera } from "three";
import { Lights } from "../src/scene/lights.ts";
import { Looks } from "../src/scene/looks.ts";
import type { GeomEntry, PackHeader } from "../src/scene/pack.ts";
import { Plane } from "../src/scene/planes.ts";
import { Textures } from "../src/scene/textures.ts";

const HEADER = {
  vis: { headlight: { active: 0, ambient: [0, 0, 0], diffuse: [0, 0, 0], specular: [0, 0, 0] } },
  lights: [],
  textures: [{ name: "checker", type: "2d", width: 2, height: 2, png: { offset: 0, size: 0 } }],
  materials: [
    {
      name: "floor",
      rgba: [1, 1, 1, 1],
      emission: 0,
      specular: 0,
      shininess: 0,
      reflectance: 0,
      texture: 0,
      texrepeat: [3, 5],
      texuniform: true,
    },
  ],
} as unknown as PackHeader;

function plane(size: number[]): Plane {
  const entry = {
    id: 0,
    name: "floor",
    body: 0,
    type: "plane",
    size,
    pos: [0, 0, 0],
    quat: [1, 0, 0, 0],
    rgba: [1, 1, 1, 1],
    material: 0,
    group: 0,
  } satisfies GeomEntry;
  const textures = Object.assign(Object.create(Textures.prototype), { get: () => null }) as Textures;
  const made = new Plane(entry, new Looks(HEADER, textures, new Lights(HEADER)), 50, 0);
  made.part.mesh.updateMatrixWorld();
  return made;
}

function seenFrom(made: Plane, x: number, y: number, z: number): Plane {
  const camera = new PerspectiveCamera();
  camera.position.set(x, y, z);
  camera.updateMatrixWorld();
  made.part.mesh.updateMatrixWorld();
  made.update(camera);
  return made;
}

/** Returns the texture coordinates at a point of the plane, from 0 to 1. */
function uvAt({ part }: Plane, x: number, y: number): [number, number] {
  const { geometry } = part.mesh;
  const [p, uv] = [geometry.getAttribute("position"), geometry.getAttribute("uv")];
  // Three vertices that span the plane.
  const [a, b, c] = [0, 1, Math.floor(p.count / 3)];
  const [ux, uy, vx, vy] = [p.getX(b) - p.getX(a), p.getY(b) - p.getY(a), p.getX(c) - p.getX(a), p.getY(c) - p.getY(a)];
  const det = ux * vy - uy * vx;
  const [dx, dy] = [x - p.getX(a), y - p.getY(a)];
  const [s, t] = [(dx * vy - dy * vx) / det, (dy * ux - dx * uy) / det];
  const at = (get: (index: number) => number) => get(a) + s * (get(b) - get(a)) + t * (get(c) - get(a));
  const wrap = (value: number) => value - Math.floor(value);
  return [wrap(at((index) => uv.getX(index))), wrap(at((index) => uv.getY(index)))];
}

function close(actual: readonly number[], expected: readonly number[], tolerance = 1e-3): void {
  actual.forEach((value, index) => assert.ok(Math.abs(value - expected[index]!) < tolerance, `${actual} ${expected}`));
}

test("an infinite plane is around the camera, and its texture stays where it is", () => {
  const made = seenFrom(plane([0, 0, 1]), 0, 0, 2);
  const before = uvAt(made, 0.3, 0.2);
  // u = 0.5 * 3 * x - 0.5, v = -0.5 * 5 * y - 0.5
  close(before, [0.95, 0]);
  seenFrom(made, 37.3, -12.9, 2);
  close(uvAt(made, 0.3, 0.2), before);
  const position = made.part.mesh.geometry.getAttribute("position");
  close([position.getX(0), position.getY(0), position.getZ(0)], [37.3, -12.9, 0]);
  assert.ok(made.endless);
});

test("far from the origin, the texture of an infinite plane keeps its precision", () => {
  const made = seenFrom(plane([0, 0, 1]), 100_000, 0, 2);
  const uv = made.part.mesh.geometry.getAttribute("uv");
  assert.ok(Math.abs(uv.getX(0)) < 2);
});

test("a plane that is infinite in one direction has borders in the other", () => {
  const made = seenFrom(plane([0, 2, 1]), 100, 100, 2);
  const position = made.part.mesh.geometry.getAttribute("position");
  const ys = Array.from({ length: position.count }, (_, index) => position.getY(index));
  assert.deepEqual([Math.min(...ys), Math.max(...ys)], [-2, 2]);
  assert.equal(made.endless, false);
});

test("a finite plane has its size and repeats the texture for each metre", () => {
  const made = seenFrom(plane([2, 1, 1]), 0, 0, 3);
  const uv = made.part.mesh.geometry.getAttribute("uv");
  close([uv.getX(2), uv.getY(2), uv.getX(0), uv.getY(0)], [6, 0, 0, 5]);
});

test("a plane is transparent from behind", () => {
  const made = seenFrom(plane([2, 1, 1]), 0, 0, 3);
  assert.equal(made.part.mesh.material.transparent, false);
  seenFrom(made, 0, 0, -3);
  assert.equal(made.part.mesh.material.transparent, true);
  assert.ok(Math.abs(made.part.mesh.material.opacity - 0.51) < 1e-6);
  seenFrom(made, 0, 0, 3);
  assert.equal(made.part.mesh.material.transparent, false);
});
