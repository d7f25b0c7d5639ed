import { BufferAttribute, BufferGeometry, DynamicDrawUsage, Mesh } from "three";
import type { Looks } from "./looks.ts";
import { mappingOf, repeats } from "./mapping.ts";
import type { FlexEntry, Pack } from "./pack.ts";
import { type Part, clampGroup } from "./part.ts";
import { shape } from "./shapes.ts";
import { smallestIndices } from "./surface.ts";

/** Sides of the tubes with which a rope is drawn. */
const ROPE_SLICES = 10;

/** A deformable object: a rope, a cloth or a soft body. */
export class Flex {
  readonly part: Part;
  readonly #update: (vertices: Float32Array) => void;

  constructor(
    readonly entry: FlexEntry,
    pack: Pack,
    looks: Looks,
  ) {
    const elements = pack.array(entry.elements);
    const material = entry.uv === undefined ? undefined : looks.material(entry.material);
    const mapping = mappingOf(looks.header.textures[material?.texture ?? -1]);
    const textured = mapping === "2d" && entry.uv !== undefined && entry.dim > 1;
    const corners = textured
      ? corner(elements, entry.uv_elements === undefined ? elements : pack.array(entry.uv_elements))
      : corner(elements, null);
    const build = entry.dim === 1 ? rope(entry, elements) : skin(entry, corners.indices, corners.vertices);
    this.#update = build.update;
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(build.positions, 3).setUsage(DynamicDrawUsage));
    geometry.setAttribute("normal", new BufferAttribute(build.normals, 3).setUsage(DynamicDrawUsage));
    geometry.setIndex(new BufferAttribute(smallestIndices(build.indices, build.positions.length / 3), 1));
    if (textured && material !== undefined && entry.uv !== undefined) {
      const uv = pack.floats(entry.uv);
      const [u, v] = repeats(material, [entry.radius, 0.1, 0.1]);
      const coordinates = new Float32Array((2 * build.positions.length) / 3);
      build.corners.forEach((index, vertex) => {
        const source = corners.uv[index]!;
        coordinates[2 * vertex] = u * uv[2 * source]!;
        coordinates[2 * vertex + 1] = v * uv[2 * source + 1]!;
      });
      geometry.setAttribute("uv", new BufferAttribute(coordinates, 2));
    }
    const map = textured ? looks.textures.get(material?.texture ?? -1) : null;
    const mesh = new Mesh(geometry, looks.own(entry, { flat: entry.flat ?? false, map }));
    // The vertices are in the world frame and move.
    mesh.frustumCulled = false;
    const shapes = [{ corner: 0, id: entry.id }];
    this.part = { mesh, kind: "flex", group: clampGroup(entry.group), body: 0, dynamic: true, shadow: true, shapes };
  }

  /** Moves the vertices. `all` has 3 numbers for each flex vertex of the model. */
  update(all: Float32Array): void {
    const { first_vertex: first, vertices } = this.entry;
    if (all.length < 3 * (first + vertices)) return;
    this.#update(all.subarray(3 * first, 3 * (first + vertices)));
    const { geometry } = this.part.mesh;
    geometry.getAttribute("position").needsUpdate = true;
    geometry.getAttribute("normal").needsUpdate = true;
    geometry.boundingSphere = null;
    geometry.boundingBox = null;
  }
}

interface Corners {
  /** Triangle corners as indices into `vertices` and `uv`. */
  readonly indices: number[];
  /** The flex vertex of each corner. */
  readonly vertices: number[];
  /** The texture coordinates of each corner. */
  readonly uv: number[];
}

/** Makes one corner for each combination of vertex and texture coordinates. */
function corner(elements: ArrayLike<number>, uv: ArrayLike<number> | null): Corners {
  const known = new Map<string, number>();
  const corners: Corners = { indices: [], vertices: [], uv: [] };
  for (let index = 0; index < elements.length; index += 1) {
    const [vertex, coordinate] = [elements[index]!, uv === null ? 0 : uv[index]!];
    const key = `${vertex} ${coordinate}`;
    let found = known.get(key);
    if (found === undefined) {
      found = corners.vertices.length;
      known.set(key, found);
      corners.vertices.push(vertex);
      corners.uv.push(coordinate);
    }
    corners.indices.push(found);
  }
  return corners;
}

interface Build {
  readonly positions: Float32Array;
  readonly normals: Float32Array;
  readonly indices: number[];
  /** The corner that each vertex belongs to. */
  readonly corners: number[];
  update(vertices: Float32Array): void;
}

/** The surface of a soft body, or both sides and the border of a cloth, at a distance of `radius` from the vertices. */
function skin(entry: FlexEntry, indices: readonly number[], vertexOf: readonly number[]): Build {
  const count = vertexOf.length;
  const cloth = entry.dim === 2;
  const rim = cloth ? border(indices, vertexOf) : [];
  const total = count * (cloth ? 2 : 1) + 4 * rim.length;
  const positions = new Float32Array(3 * total);
  const normals = new Float32Array(3 * total);
  const corners = [...vertexOf.keys()];
  const all = [...indices];
  if (cloth) {
    corners.push(...vertexOf.keys());
    for (let index = 0; index < indices.length; index += 3) {
      all.push(count + indices[index]!, count + indices[index + 2]!, count + indices[index + 1]!);
    }
    rim.forEach(([a, b], index) => {
      const first = 2 * count + 4 * index;
      corners.push(a, b, a, b);
      // Upper a, upper b, lower a, lower b.
      all.push(first, first + 2, first + 3, first, first + 3, first + 1);
    });
  }
  const smooth = new Float32Array(3 * entry.vertices);
  const put = (target: number, vertices: Float32Array, vertex: number, offset: number, normalSign: number) => {
    for (let axis = 0; axis < 3; axis += 1) {
      const normal = smooth[3 * vertex + axis]!;
      positions[3 * target + axis] = vertices[3 * vertex + axis]! + offset * normal;
      normals[3 * target + axis] = normalSign * normal;
    }
  };
  const update = (vertices: Float32Array) => {
    vertexNormals(vertices, indices, vertexOf, smooth);
    for (let index = 0; index < count; index += 1) {
      put(index, vertices, vertexOf[index]!, entry.radius, 1);
      if (cloth) put(count + index, vertices, vertexOf[index]!, -entry.radius, -1);
    }
    rim.forEach(([a, b], index) => {
      const first = 2 * count + 4 * index;
      const [va, vb] = [vertexOf[a]!, vertexOf[b]!];
      put(first, vertices, va, entry.radius, 1);
      put(first + 1, vertices, vb, entry.radius, 1);
      put(first + 2, vertices, va, -entry.radius, 1);
      put(first + 3, vertices, vb, -entry.radius, 1);
      outward(vertices, va, vb, smooth, normals, first);
    });
  };
  return { positions, normals, indices: all, corners, update };
}

/** Returns the edges that belong to one triangle only, as corners in the order of the triangle. */
function border(indices: readonly number[], vertexOf: readonly number[]): [number, number][] {
  const edges = new Map<string, [number, number] | null>();
  for (let index = 0; index < indices.length; index += 3) {
    for (const [from, to] of [
      [0, 1],
      [1, 2],
      [2, 0],
    ] as const) {
      const [a, b] = [indices[index + from]!, indices[index + to]!];
      const key = [vertexOf[a]!, vertexOf[b]!].sort((x, y) => x - y).join(" ");
      edges.set(key, edges.has(key) ? null : [a, b]);
    }
  }
  return [...edges.values()].filter((edge) => edge !== null);
}

/** Sets the normals of 4 vertices at the border: across the edge and the normal of the surface. */
function outward(
  vertices: Float32Array,
  a: number,
  b: number,
  smooth: Float32Array,
  normals: Float32Array,
  first: number,
): void {
  const [ex, ey, ez] = [0, 1, 2].map((axis) => vertices[3 * b + axis]! - vertices[3 * a + axis]!) as Numbers;
  const [nx, ny, nz] = [0, 1, 2].map((axis) => smooth[3 * b + axis]!) as Numbers;
  const [x, y, z] = [ey * nz - ez * ny, ez * nx - ex * nz, ex * ny - ey * nx];
  const length = Math.hypot(x, y, z) || 1;
  for (let index = first; index < first + 4; index += 1) {
    normals.set([x / length, y / length, z / length], 3 * index);
  }
}

type Numbers = [number, number, number];

/** Computes the mean of the normals of the triangles around each vertex. */
function vertexNormals(
  vertices: Float32Array,
  indices: readonly number[],
  vertexOf: readonly number[],
  normals: Float32Array,
): void {
  normals.fill(0);
  for (let index = 0; index < indices.length; index += 3) {
    const a = 3 * vertexOf[indices[index]!]!;
    const b = 3 * vertexOf[indices[index + 1]!]!;
    const c = 3 * vertexOf[indices[index + 2]!]!;
    const [ux, uy, uz] = [
      vertices[b]! - vertices[a]!,
      vertices[b + 1]! - vertices[a + 1]!,
      vertices[b + 2]! - vertices[a + 2]!,
    ];
    const [vx, vy, vz] = [
      vertices[c]! - vertices[a]!,
      vertices[c + 1]! - vertices[a + 1]!,
      vertices[c + 2]! - vertices[a + 2]!,
    ];
    const [x, y, z] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    const length = Math.hypot(x, y, z) || 1;
    for (const vertex of [a, b, c]) {
      normals[vertex]! += x / length;
      normals[vertex + 1]! += y / length;
      normals[vertex + 2]! += z / length;
    }
  }
  for (let start = 0; start < normals.length; start += 3) {
    const length = Math.hypot(normals[start]!, normals[start + 1]!, normals[start + 2]!) || 1;
    for (let axis = 0; axis < 3; axis += 1) normals[start + axis]! /= length;
  }
}

/** A tube along each line. */
function rope(entry: FlexEntry, elements: ArrayLike<number>): Build {
  const tube = shape("cylinder", [1, 1, 1], ROPE_SLICES)!;
  const perTube = tube.positions.length / 3;
  const tubes = elements.length / 2;
  const positions = new Float32Array(3 * perTube * tubes);
  const normals = new Float32Array(3 * perTube * tubes);
  const indices: number[] = [];
  for (let index = 0; index < tubes; index += 1) {
    for (let at = 0; at < tube.indices.length; at += 1) indices.push(index * perTube + tube.indices[at]!);
  }
  const update = (vertices: Float32Array) => {
    for (let index = 0; index < tubes; index += 1) {
      const [a, b] = [3 * elements[2 * index]!, 3 * elements[2 * index + 1]!];
      const along = [0, 1, 2].map((axis) => vertices[b + axis]! - vertices[a + axis]!) as Numbers;
      const half = Math.hypot(...along) / 2 || 1e-9;
      const z = along.map((value) => value / (2 * half)) as Numbers;
      const helper: Numbers = Math.abs(z[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
      const x = unit(cross(helper, z));
      const y = cross(z, x);
      for (let vertex = 0; vertex < perTube; vertex += 1) {
        const [px, py, pz] = [0, 1, 2].map((axis) => tube.positions[3 * vertex + axis]!) as Numbers;
        const [nx, ny, nz] = [0, 1, 2].map((axis) => tube.normals[3 * vertex + axis]!) as Numbers;
        for (let axis = 0; axis < 3; axis += 1) {
          const at = 3 * (index * perTube + vertex) + axis;
          const center = (vertices[a + axis]! + vertices[b + axis]!) / 2;
          positions[at] = center + entry.radius * (px * x[axis]! + py * y[axis]!) + half * pz * z[axis]!;
          normals[at] = nx * x[axis]! + ny * y[axis]! + nz * z[axis]!;
        }
      }
    }
  };
  return { positions, normals, indices, corners: [], update };
}

function cross([ax, ay, az]: Numbers, [bx, by, bz]: Numbers): Numbers {
  return [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx];
}

function unit([x, y, z]: Numbers): Numbers {
  const length = Math.hypot(x, y, z) || 1;
  return [x / length, y / length, z / length];
}
