import type { HeightFieldEntry, MeshEntry, Pack } from "./pack.ts";
import type { Surface } from "./surface.ts";

/** Cosine of the angle between the normals of a vertex and of its triangle from which MuJoCo draws an edge. */
const EDGE = 0.8;

/** The meshes and height fields of a pack; each is read once. */
export class Assets {
  readonly #meshes = new Map<number, Surface>();
  readonly #heightFields = new Map<number, Surface>();

  constructor(readonly pack: Pack) {}

  mesh(id: number): Surface | null {
    return this.#read(this.#meshes, this.pack.header.meshes, id, (entry) => readMesh(this.pack, entry));
  }

  heightField(id: number): Surface | null {
    return this.#read(this.#heightFields, this.pack.header.hfields, id, (entry) => readHeightField(this.pack, entry));
  }

  #read<E extends { readonly id: number }>(
    known: Map<number, Surface>,
    entries: readonly E[],
    id: number,
    read: (entry: E) => Surface,
  ): Surface | null {
    const entry = entries.find((candidate) => candidate.id === id);
    if (entry === undefined) return null;
    const surface = known.get(id) ?? read(entry);
    known.set(id, surface);
    return surface;
  }
}

function readMesh(pack: Pack, entry: MeshEntry): Surface {
  const surface = {
    positions: pack.floats(entry.positions),
    normals: Float32Array.from(pack.array(entry.normals), (value) => value / 127),
    indices: pack.array(entry.indices),
  };
  return entry.uv === undefined ? sharpen(surface) : { ...surface, uv: pack.floats(entry.uv) };
}

/** Gives corners at sharp edges the normal of their triangle, as MuJoCo does for meshes without texture coordinates. */
export function sharpen({ positions, normals, indices }: Surface): Surface {
  const count = positions.length / 3;
  const sharpIndices = Uint32Array.from(indices);
  const added: number[] = [];
  for (let corner = 0; corner + 2 < indices.length; corner += 3) {
    const a = 3 * indices[corner]!;
    const b = 3 * indices[corner + 1]!;
    const c = 3 * indices[corner + 2]!;
    const abx = positions[b]! - positions[a]!;
    const aby = positions[b + 1]! - positions[a + 1]!;
    const abz = positions[b + 2]! - positions[a + 2]!;
    const acx = positions[c]! - positions[a]!;
    const acy = positions[c + 1]! - positions[a + 1]!;
    const acz = positions[c + 2]! - positions[a + 2]!;
    let x = aby * acz - abz * acy;
    let y = abz * acx - abx * acz;
    let z = abx * acy - aby * acx;
    const length = Math.hypot(x, y, z);
    if (length === 0) continue;
    x /= length;
    y /= length;
    z /= length;
    for (let index = 0; index < 3; index += 1) {
      const vertex = 3 * indices[corner + index]!;
      if (x * normals[vertex]! + y * normals[vertex + 1]! + z * normals[vertex + 2]! < EDGE) {
        sharpIndices[corner + index] = count + added.length / 6;
        added.push(positions[vertex]!, positions[vertex + 1]!, positions[vertex + 2]!, x, y, z);
      }
    }
  }
  if (added.length === 0) return { positions, normals, indices };
  const total = count + added.length / 6;
  const allPositions = new Float32Array(3 * total);
  const allNormals = new Float32Array(3 * total);
  allPositions.set(positions);
  allNormals.set(normals);
  for (let index = 0; 6 * index < added.length; index += 1) {
    for (let axis = 0; axis < 3; axis += 1) {
      allPositions[3 * (count + index) + axis] = added[6 * index + axis]!;
      allNormals[3 * (count + index) + axis] = added[6 * index + 3 + axis]!;
    }
  }
  return { positions: allPositions, normals: allNormals, indices: sharpIndices };
}

/** Returns terrain, sides and bottom. It has no normals: each triangle is flat, which the shader computes. */
export function readHeightField(pack: Pack, entry: HeightFieldEntry): Surface {
  const [rows, columns] = entry.elevation.shape as [number, number];
  const elevation = pack.floats(entry.elevation);
  const [x, y, height, depth] = entry.size as [number, number, number, number];
  const border = 2 * (rows + columns) - 4;
  const positions = new Float32Array(3 * (rows * columns + 2 * border + 4));
  const indices: number[] = [];
  const put = (vertex: number, row: number, column: number, z: number) => {
    positions[3 * vertex] = x * ((2 * column) / (columns - 1) - 1);
    positions[3 * vertex + 1] = y * ((2 * row) / (rows - 1) - 1);
    positions[3 * vertex + 2] = z;
  };
  for (let row = 0; row < rows; row += 1) {
    for (let column = 0; column < columns; column += 1) {
      const vertex = row * columns + column;
      put(vertex, row, column, height * elevation[vertex]!);
      if (row + 1 < rows && column + 1 < columns) {
        const above = vertex + columns;
        indices.push(above, vertex, above + 1, vertex, vertex + 1, above + 1);
      }
    }
  }
  let top = rows * columns;
  walls(rows, columns, (row, column, next) => {
    put(top, row, column, height * elevation[row * columns + column]!);
    put(top + border, row, column, -depth);
    const after = next ? top + 1 : rows * columns;
    indices.push(top + border, after + border, after, top + border, after, top);
    top += 1;
  });
  const bottom = rows * columns + 2 * border;
  put(bottom, 0, 0, -depth);
  put(bottom + 1, rows - 1, 0, -depth);
  put(bottom + 2, rows - 1, columns - 1, -depth);
  put(bottom + 3, 0, columns - 1, -depth);
  indices.push(bottom, bottom + 1, bottom + 2, bottom, bottom + 2, bottom + 3);
  return { positions, normals: new Float32Array(positions.length), indices };
}

/** Visits the border of a grid counter-clockwise; `next` is false for the last point. */
function walls(rows: number, columns: number, visit: (row: number, column: number, next: boolean) => void): void {
  const points: [number, number][] = [];
  for (let column = 0; column < columns - 1; column += 1) points.push([0, column]);
  for (let row = 0; row < rows - 1; row += 1) points.push([row, columns - 1]);
  for (let column = columns - 1; column > 0; column -= 1) points.push([rows - 1, column]);
  for (let row = rows - 1; row > 0; row -= 1) points.push([row, 0]);
  points.forEach(([row, column], index) => visit(row, column, index + 1 < points.length));
}
