import { BufferAttribute, BufferGeometry, type Camera, type Matrix4, Matrix4 as Pose, Mesh, Vector3 } from "three";
import { poseOf } from "./geoms.ts";
import type { Looks } from "./looks.ts";
import { mappingOf, repeats } from "./mapping.ts";
import type { GeomEntry, MaterialEntry } from "./pack.ts";
import { type Part, clampGroup } from "./part.ts";
import type { Shading } from "./shading.ts";

/** Number of corners of an infinite plane, which is drawn as a disk around the camera. */
const CORNERS = 64;

/** MuJoCo's sky is at this fraction of the far clipping distance and hides what is behind it. */
export const SKY_DISTANCE = 0.7;

/** From behind, a plane is drawn with this fraction of its alpha. */
const BACK_ALPHA = 0.3;

/** A plane geom, finite or infinite in each direction. It becomes transparent when the camera is behind it. */
export class Plane {
  readonly part: Part;
  readonly #size: readonly [number, number];
  readonly #material: MaterialEntry | undefined;
  readonly #textured: boolean;
  readonly #relative: Matrix4;
  readonly #eye = new Vector3();
  readonly #inverse = new Pose();
  readonly #drawn = new Vector3(NaN, NaN, NaN);
  #behind = false;
  #fade = 1;

  /**
   * @param radius - How far an infinite plane reaches [m].
   * @param depth - Where planes have the same height, the one with the lowest number is drawn on top.
   */
  constructor(
    entry: GeomEntry,
    looks: Looks,
    readonly radius: number,
    depth: number,
  ) {
    this.#size = [entry.size[0]!, entry.size[1]!];
    this.#material = looks.material(entry.material);
    const index = this.#material?.texture ?? -1;
    const mapping = mappingOf(looks.header.textures[index]);
    this.#textured = mapping === "2d";
    const texture = looks.textures.get(index);
    const geometry = this.infinite ? disk() : rectangle(this.#size);
    const shading = looks.own(entry, {
      map: this.#textured ? texture : null,
      cube: mapping === "cube" ? texture : null,
      doubleSided: true,
    });
    if (depth > 0)
      Object.assign(shading, { polygonOffset: true, polygonOffsetFactor: depth, polygonOffsetUnits: depth });
    const mesh = new Mesh(geometry, shading);
    mesh.matrixAutoUpdate = false;
    // The vertices move with the camera.
    mesh.frustumCulled = !this.infinite;
    this.#relative = poseOf(entry);
    mesh.matrix.copy(this.#relative);
    if (mapping === "cube") geometry.setAttribute("direction", geometry.getAttribute("position"));
    const shapes = [{ corner: 0, id: entry.id }];
    this.part = {
      mesh,
      kind: "geom",
      group: clampGroup(entry.group),
      body: entry.body,
      dynamic: false,
      shadow: false,
      shapes,
    };
    if (!this.infinite) this.#texture(0, 0);
  }

  get infinite(): boolean {
    return this.#size[0] <= 0 || this.#size[1] <= 0;
  }

  /** Whether the plane is infinite in both directions; MuJoCo draws haze at the horizon of such a plane. */
  get endless(): boolean {
    return this.#size[0] <= 0 && this.#size[1] <= 0;
  }

  /** Multiplies the alpha. */
  fade(factor: number): void {
    this.#fade = factor;
    this.#setAlpha();
  }

  /** Moves the vertices to the camera; call it before the scene is drawn with a camera. */
  update(camera: Camera): void {
    const { mesh } = this.part;
    this.#inverse.copy(mesh.matrixWorld).invert();
    this.#eye.setFromMatrixPosition(camera.matrixWorld).applyMatrix4(this.#inverse);
    const behind = this.#eye.z < 0;
    if (behind !== this.#behind) {
      this.#behind = behind;
      this.#setAlpha();
    }
    if (this.infinite && !this.#eye.equals(this.#drawn)) {
      this.#drawn.copy(this.#eye);
      this.#recenter(this.#eye.x, this.#eye.y);
    }
  }

  #setAlpha(): void {
    (this.part.mesh.material as Shading).fade(this.#fade * (this.#behind ? BACK_ALPHA : 1));
  }

  #recenter(x: number, y: number): void {
    const positions = this.part.mesh.geometry.getAttribute("position") as BufferAttribute;
    const [a, b] = this.#size;
    const place = (vertex: number, cos: number, sin: number) =>
      positions.setXYZ(vertex, coordinate(a, x, this.radius * cos), coordinate(b, y, this.radius * sin), 0);
    place(0, 0, 0);
    for (let corner = 0; corner < CORNERS; corner += 1) {
      const angle = (2 * Math.PI * corner) / CORNERS;
      place(corner + 1, Math.cos(angle), Math.sin(angle));
    }
    positions.needsUpdate = true;
    this.part.mesh.geometry.boundingSphere = null;
    this.part.mesh.geometry.boundingBox = null;
    this.#texture(x, y);
  }

  /** Lays the texture onto the plane. It does not move with the camera, because it repeats in whole numbers. */
  #texture(x: number, y: number): void {
    if (!this.#textured || this.#material === undefined) return;
    const { geometry } = this.part.mesh;
    const positions = geometry.getAttribute("position");
    const uv = geometry.getAttribute("uv") as BufferAttribute;
    const [a, b] = this.#size;
    const [u, v] = repeats(this.#material, [a, b, 0]);
    const shift = this.infinite ? 0.5 : 0;
    // Small numbers keep the precision of the texture far from the origin.
    const [startU, startV] = [Math.floor(0.5 * u * x), Math.floor(-0.5 * v * y)];
    for (let vertex = 0; vertex < positions.count; vertex += 1) {
      const [px, py] = [positions.getX(vertex), positions.getY(vertex)];
      const s = a > 0 ? (px + a) / (2 * a) : 0.5 * px;
      const t = b > 0 ? 1 - (py + b) / (2 * b) : -0.5 * py;
      uv.setXY(vertex, u * s - shift - startU, v * t - shift - startV);
    }
    uv.needsUpdate = true;
  }
}

/** Returns a coordinate of a vertex: within the plane if it is finite, else around the camera. */
function coordinate(size: number, eye: number, offset: number): number {
  return size > 0 ? Math.max(-size, Math.min(size, offset)) : eye + offset;
}

function disk(): BufferGeometry {
  const indices: number[] = [];
  for (let corner = 1; corner <= CORNERS; corner += 1) indices.push(0, corner, (corner % CORNERS) + 1);
  return flat(new Float32Array(3 * (CORNERS + 1)), indices);
}

function rectangle([x, y]: readonly [number, number]): BufferGeometry {
  return flat(new Float32Array([-x, -y, 0, x, -y, 0, x, y, 0, -x, y, 0]), [0, 1, 2, 0, 2, 3]);
}

function flat(positions: Float32Array, indices: number[]): BufferGeometry {
  const count = positions.length / 3;
  const normals = new Float32Array(positions.length).map((_, index) => (index % 3 === 2 ? 1 : 0));
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(positions, 3));
  geometry.setAttribute("normal", new BufferAttribute(normals, 3));
  geometry.setAttribute("uv", new BufferAttribute(new Float32Array(2 * count), 2));
  geometry.setIndex(indices);
  return geometry;
}
