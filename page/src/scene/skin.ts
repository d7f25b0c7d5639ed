import { BufferAttribute, BufferGeometry, DynamicDrawUsage, Matrix4, Mesh, type Object3D, Vector3 } from "three";
import { poseOf } from "./geoms.ts";
import type { Looks } from "./looks.ts";
import { mapTexture, mappingOf } from "./mapping.ts";
import type { Pack, SkinEntry } from "./pack.ts";
import { type Part, clampGroup } from "./part.ts";
import { smallestIndices } from "./surface.ts";

interface Bone {
  readonly body: number;
  /** From the skin's frame in its bind pose to the frame of the body. */
  readonly unbind: Matrix4;
  readonly vertices: ArrayLike<number>;
  readonly weights: ArrayLike<number>;
}

/** The size with which MuJoCo computes texture coordinates of skins. */
const SIZE = [0.1, 0.1, 0.1] as const;

/** A mesh whose vertices follow several bodies. */
export class Skin {
  readonly part: Part;
  readonly #bones: readonly Bone[];
  readonly #bound: Float32Array;
  readonly #positions: Float32Array;
  readonly #normals: Float32Array;
  readonly #indices: ArrayLike<number>;

  constructor(
    readonly entry: SkinEntry,
    pack: Pack,
    looks: Looks,
  ) {
    this.#bound = pack.floats(entry.positions);
    this.#indices = pack.array(entry.indices);
    this.#positions = this.#bound.slice();
    this.#normals = new Float32Array(this.#bound.length);
    this.#bones = entry.bones.map((bone) => ({
      body: bone.body,
      unbind: poseOf(bone).invert(),
      vertices: pack.array(bone.vertices),
      weights: pack.array(bone.weights),
    }));
    const material = looks.material(entry.material);
    const texture = looks.textures.get(material?.texture ?? -1);
    const mapping = mappingOf(looks.header.textures[material?.texture ?? -1]);
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(this.#positions, 3).setUsage(DynamicDrawUsage));
    geometry.setAttribute("normal", new BufferAttribute(this.#normals, 3).setUsage(DynamicDrawUsage));
    geometry.setIndex(new BufferAttribute(smallestIndices(this.#indices, this.#bound.length / 3), 1));
    const surface = {
      positions: this.#bound,
      normals: this.#normals,
      indices: this.#indices,
      ...(entry.uv === undefined ? {} : { uv: pack.floats(entry.uv) }),
    };
    const { uv, directions } = mapTexture(surface, mapping, material, SIZE, false);
    if (mapping === "2d" && uv !== undefined) geometry.setAttribute("uv", new BufferAttribute(uv, 2));
    if (mapping === "cube" && directions !== undefined) {
      geometry.setAttribute("direction", new BufferAttribute(directions, 3));
    }
    const options = { map: mapping === "2d" ? texture : null, cube: mapping === "cube" ? texture : null };
    const mesh = new Mesh(geometry, looks.own(entry, options));
    mesh.frustumCulled = false;
    const shapes = [{ corner: 0, id: entry.id }];
    const body = this.#bones[0]?.body ?? 0;
    this.part = { mesh, kind: "skin", group: clampGroup(entry.group), body, dynamic: true, shadow: true, shapes };
  }

  /** Moves the vertices with the bodies, whose poses are relative to the world. */
  update(bodies: readonly Object3D[]): void {
    this.#positions.fill(0);
    const move = new Matrix4();
    const vector = new Vector3();
    for (const { body, unbind, vertices, weights } of this.#bones) {
      const { position, quaternion, scale } = bodies[body]!;
      move.compose(position, quaternion, scale).multiply(unbind);
      for (let index = 0; index < vertices.length; index += 1) {
        const start = 3 * vertices[index]!;
        const weight = weights[index]!;
        vector.fromArray(this.#bound, start).applyMatrix4(move);
        this.#positions[start]! += weight * vector.x;
        this.#positions[start + 1]! += weight * vector.y;
        this.#positions[start + 2]! += weight * vector.z;
      }
    }
    this.#computeNormals();
    const { inflate } = this.entry;
    if (inflate !== 0) {
      for (let index = 0; index < this.#positions.length; index += 1) {
        this.#positions[index]! += inflate * this.#normals[index]!;
      }
    }
    const { geometry } = this.part.mesh;
    geometry.getAttribute("position").needsUpdate = true;
    geometry.getAttribute("normal").needsUpdate = true;
    geometry.boundingSphere = null;
    geometry.boundingBox = null;
  }

  /** Computes the mean of the normals of the triangles around each vertex, weighted by their areas. */
  #computeNormals(): void {
    const [p, n, indices] = [this.#positions, this.#normals, this.#indices];
    n.fill(0);
    for (let index = 0; index + 2 < indices.length; index += 3) {
      const [a, b, c] = [3 * indices[index]!, 3 * indices[index + 1]!, 3 * indices[index + 2]!];
      const [ux, uy, uz] = [p[b]! - p[a]!, p[b + 1]! - p[a + 1]!, p[b + 2]! - p[a + 2]!];
      const [vx, vy, vz] = [p[c]! - p[a]!, p[c + 1]! - p[a + 1]!, p[c + 2]! - p[a + 2]!];
      const [x, y, z] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
      for (const vertex of [a, b, c]) {
        n[vertex]! += x;
        n[vertex + 1]! += y;
        n[vertex + 2]! += z;
      }
    }
    for (let start = 0; start < n.length; start += 3) {
      const length = Math.hypot(n[start]!, n[start + 1]!, n[start + 2]!) || 1;
      n[start]! /= length;
      n[start + 1]! /= length;
      n[start + 2]! /= length;
    }
  }
}
