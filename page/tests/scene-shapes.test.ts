import assert from "node:assert/strict";
import { test } from "node:test";
import { Matrix4 } from "three";
import { sharpen } from "../src/scene/assets.ts";
import { mapTexture } from "../src/scene/mapping.ts";
import type { MaterialEntry } from "../src/scene/pack.ts";
import { shape, sizeOf } from "../src/scene/shapes.ts";
import { merge, type Surface, type Triple } from "../src/scene/surface.ts";

/** Returns the volume inside a closed surface whose triangles are counter-clockwise from outside. */
function volume({ positions: p, indices }: Surface): number {
  let sum = 0;
  for (let corner = 0; corner < indices.length; corner += 3) {
    const [a, b, c] = [3 * indices[corner]!, 3 * indices[corner + 1]!, 3 * indices[corner + 2]!];
    sum +=
      p[a]! * (p[b + 1]! * p[c + 2]! - p[b + 2]! * p[c + 1]!) +
      p[a + 1]! * (p[b + 2]! * p[c]! - p[b]! * p[c + 2]!) +
      p[a + 2]! * (p[b]! * p[c + 1]! - p[b + 1]! * p[c]!);
  }
  return sum / 6;
}

/** Returns the least cosine between the normal of a triangle and those of its corners. */
function worstNormal({ positions: p, normals: n, indices }: Surface): number {
  let worst = 1;
  for (let corner = 0; corner < indices.length; corner += 3) {
    const [a, b, c] = [3 * indices[corner]!, 3 * indices[corner + 1]!, 3 * indices[corner + 2]!];
    const u = [0, 1, 2].map((axis) => p[b + axis]! - p[a + axis]!) as [number, number, number];
    const v = [0, 1, 2].map((axis) => p[c + axis]! - p[a + axis]!) as [number, number, number];
    const face = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const length = Math.hypot(...face);
    if (length < 1e-9) continue;
    for (const vertex of [a, b, c]) {
      worst = Math.min(worst, face.reduce((sum, value, axis) => sum + value * n[vertex + axis]!, 0) / length);
    }
  }
  return worst;
}

const SOLIDS: [string, Triple, number][] = [
  ["sphere", [0.5, 0.5, 0.5], (4 / 3) * Math.PI * 0.125],
  ["ellipsoid", [0.2, 0.3, 0.5], (4 / 3) * Math.PI * 0.03],
  ["capsule", [0.2, 0.2, 0.5], Math.PI * 0.04 + (4 / 3) * Math.PI * 0.008],
  ["cylinder", [0.2, 0.2, 0.5], Math.PI * 0.04],
  ["box", [0.2, 0.3, 0.5], 8 * 0.03],
];

for (const [type, size, expected] of SOLIDS) {
  test(`a ${type} has the volume of its size, and its normals point outwards`, () => {
    const surface = shape(type, size, 64)!;
    assert.ok(Math.abs(volume(surface) / expected - 1) < 0.01, `${volume(surface)} instead of ${expected}`);
    assert.ok(worstNormal(surface) > 0.9, `${worstNormal(surface)}`);
  });
}

for (const type of ["arrow", "arrow1", "arrow2"]) {
  test(`an ${type} is half as long as its size says, as in MuJoCo`, () => {
    const { positions } = shape(type, [0.1, 0.1, 2])!;
    const heights = positions.filter((_, index) => index % 3 === 2);
    assert.ok(Math.abs(Math.max(...heights) - 1) < 1e-6);
    assert.ok(Math.abs(Math.min(...heights) - (type === "arrow2" ? -1 : 0)) < 1e-6);
    assert.ok(worstNormal(shape(type, [0.1, 0.1, 2])!) > 0.5);
  });
}

test("sizes are those that MuJoCo scales a shape with", () => {
  assert.deepEqual(sizeOf("sphere", [1, 0, 0]), [1, 1, 1]);
  assert.deepEqual(sizeOf("capsule", [1, 2, 0]), [1, 1, 2]);
  assert.deepEqual(sizeOf("box", [1, 2, 3]), [1, 2, 3]);
});

test("an unknown shape is not drawn", () => assert.equal(shape("label", [1, 1, 1]), null));

test("merged surfaces are moved to their poses, and their normals are turned", () => {
  const box = shape("box", [1, 1, 1])!;
  const pose = new Matrix4().makeRotationX(Math.PI / 2).setPosition(5, 0, 0);
  const merged = merge(
    [
      { surface: box, pose: new Matrix4() },
      { surface: box, pose },
    ],
    "2d",
  );
  assert.equal(merged.positions.length, 2 * box.positions.length);
  assert.equal(merged.uv!.length, 2 * box.uv!.length);
  assert.ok(Math.abs(volume(merged) - 16) < 1e-5);
  assert.ok(worstNormal(merged) > 0.999);
  const second = [...merged.positions.slice(box.positions.length)].filter((_, index) => index % 3 === 0);
  assert.deepEqual([Math.min(...second), Math.max(...second)], [4, 6]);
});

test("corners at sharp edges of a mesh get the normal of their triangle", () => {
  const diagonal = Math.SQRT1_2;
  const roof: Surface = {
    positions: new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 0, -1]),
    normals: new Float32Array([0, -diagonal, diagonal, 0, 0, 1, 0, 0, 1, 0, -1, 0]),
    indices: [0, 1, 2],
  };
  const sharp = sharpen(roof);
  assert.equal(sharp.positions.length / 3, 5);
  assert.deepEqual(Array.from(sharp.indices), [4, 1, 2]);
  assert.deepEqual([...sharp.normals.slice(12)], [0, 0, 1]);
  assert.deepEqual([...sharp.positions.slice(12)], [0, 0, 0]);
});

const MATERIAL: MaterialEntry = {
  name: "",
  rgba: [1, 1, 1, 1],
  emission: 0,
  specular: 0,
  shininess: 0,
  reflectance: 0,
  texture: 0,
  texrepeat: [3, 2],
  texuniform: false,
};
const TRIANGLE: Surface = {
  positions: new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0]),
  normals: new Float32Array([0, 0, 1, 0, 0, 1, 0, 0, 1]),
  uv: new Float32Array([0, 0, 1, 0, 0, 1]),
  indices: [0, 1, 2],
};

test("texture coordinates are repeated, for each metre if the material is uniform", () => {
  const mapped = mapTexture(TRIANGLE, "2d", MATERIAL, [0.5, 4, 1], false);
  assert.deepEqual([...mapped.uv!], [0, 0, 3, 0, 0, 2]);
  const uniform = mapTexture(TRIANGLE, "2d", { ...MATERIAL, texuniform: true }, [0.5, 4, 1], false);
  assert.deepEqual([...uniform.uv!], [0, 0, 1.5, 0, 0, 8]);
});

test("a mesh without texture coordinates gets them from above, over its size", () => {
  const { positions, normals, indices } = TRIANGLE;
  const mapped = mapTexture({ positions, normals, indices }, "2d", MATERIAL, [0.5, 1, 1], true);
  // u = 0.5 * 3 / 0.5 * x - 0.5, v = -0.5 * 2 / 1 * y - 0.5
  assert.deepEqual([...mapped.uv!], [-0.5, -0.5, 2.5, -0.5, -0.5, -1.5]);
});

test("directions into a cube texture are those of the shape of size 1, or of its size if the material is uniform", () => {
  const box = shape("box", [2, 3, 4])!;
  const mapped = mapTexture(box, "cube", MATERIAL, [2, 3, 4], false);
  assert.deepEqual(new Set(mapped.directions), new Set([-1, 1]));
  const uniform = mapTexture(box, "cube", { ...MATERIAL, texuniform: true }, [2, 3, 4], false);
  assert.deepEqual([...uniform.directions!], [...box.positions]);
});
