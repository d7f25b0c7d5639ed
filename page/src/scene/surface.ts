import { BufferAttribute, BufferGeometry, type Matrix4, Vector3 } from "three";

/** Triangles of one or several shapes, as plain arrays that can be merged. */
export interface Surface {
  readonly positions: Float32Array;
  readonly normals: Float32Array;
  /** Texture coordinates, 2 numbers for each vertex. */
  readonly uv?: Float32Array;
  /** Coordinates in a cube texture, 3 numbers for each vertex. */
  readonly directions?: Float32Array;
  readonly indices: ArrayLike<number>;
}

/** Collects vertices and triangles. */
export class SurfaceBuilder {
  readonly #positions: number[] = [];
  readonly #normals: number[] = [];
  readonly #uv: number[] = [];
  readonly #directions: number[] = [];
  readonly #indices: number[] = [];

  /** Number of vertices. */
  get count(): number {
    return this.#positions.length / 3;
  }

  vertex(position: Triple, normal: Triple, u: number, v: number, direction: Triple = position): void {
    this.#positions.push(...position);
    this.#normals.push(...normal);
    this.#uv.push(u, v);
    this.#directions.push(...direction);
  }

  /** Adds triangles for a grid of vertices that were added row by row, starting at `first`. */
  grid(first: number, rows: number, columns: number): void {
    for (let row = 0; row + 1 < rows; row += 1) {
      for (let column = 0; column + 1 < columns; column += 1) {
        const a = first + row * columns + column;
        const b = a + columns;
        this.#indices.push(a, a + 1, b + 1, a, b + 1, b);
      }
    }
  }

  triangle(a: number, b: number, c: number): void {
    this.#indices.push(a, b, c);
  }

  build(): Surface {
    return {
      positions: new Float32Array(this.#positions),
      normals: new Float32Array(this.#normals),
      uv: new Float32Array(this.#uv),
      directions: new Float32Array(this.#directions),
      indices: this.#indices,
    };
  }
}

export type Triple = readonly [number, number, number];

/** Returns a geometry with only the attributes that a texture needs. */
export function geometryOf(surface: Surface, mapping: Mapping): BufferGeometry {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(surface.positions, 3));
  geometry.setAttribute("normal", new BufferAttribute(surface.normals, 3));
  if (mapping === "2d" && surface.uv !== undefined) {
    geometry.setAttribute("uv", new BufferAttribute(surface.uv, 2));
  }
  if (mapping === "cube" && surface.directions !== undefined) {
    geometry.setAttribute("direction", new BufferAttribute(surface.directions, 3));
  }
  geometry.setIndex(new BufferAttribute(smallestIndices(surface.indices, surface.positions.length / 3), 1));
  return geometry;
}

/** How a texture is laid onto a shape: not at all, by `uv`, or as a cube texture by `directions`. */
export type Mapping = "none" | "2d" | "cube";

/** Returns indices as uint16, or as uint32 if there are too many vertices. */
export function smallestIndices(indices: ArrayLike<number>, vertices: number): Uint16Array | Uint32Array {
  return vertices <= 65536 ? Uint16Array.from(indices) : Uint32Array.from(indices);
}

/** A surface and the pose at which it is merged. */
export interface Placed {
  readonly surface: Surface;
  readonly pose: Matrix4;
}

/** Returns all surfaces as one, each moved to its pose. */
export function merge(parts: readonly Placed[], mapping: Mapping): Surface {
  const vertices = parts.reduce((sum, { surface }) => sum + surface.positions.length / 3, 0);
  const triangles = parts.reduce((sum, { surface }) => sum + surface.indices.length, 0);
  const positions = new Float32Array(3 * vertices);
  const normals = new Float32Array(3 * vertices);
  const uv = new Float32Array(mapping === "2d" ? 2 * vertices : 0);
  const directions = new Float32Array(mapping === "cube" ? 3 * vertices : 0);
  const indices = new Uint32Array(triangles);
  const vector = new Vector3();
  let first = 0;
  let corner = 0;
  for (const { surface, pose } of parts) {
    const count = surface.positions.length / 3;
    for (let index = 0; index < count; index += 1) {
      vector
        .fromArray(surface.positions, 3 * index)
        .applyMatrix4(pose)
        .toArray(positions, 3 * (first + index));
      vector
        .fromArray(surface.normals, 3 * index)
        .transformDirection(pose)
        .toArray(normals, 3 * (first + index));
    }
    if (mapping === "2d" && surface.uv !== undefined) uv.set(surface.uv, 2 * first);
    if (mapping === "cube" && surface.directions !== undefined) directions.set(surface.directions, 3 * first);
    for (let index = 0; index < surface.indices.length; index += 1) {
      indices[corner + index] = first + surface.indices[index]!;
    }
    first += count;
    corner += surface.indices.length;
  }
  return { positions, normals, uv, directions, indices };
}
