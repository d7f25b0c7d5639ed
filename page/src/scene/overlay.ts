import {
  BufferAttribute,
  BufferGeometry,
  DynamicDrawUsage,
  Group,
  InstancedBufferAttribute,
  InstancedMesh,
  LineBasicMaterial,
  LineSegments,
  Matrix4,
} from "three";
import type { Lights } from "./lights.ts";
import { shape } from "./shapes.ts";
import { Shading } from "./shading.ts";
import { type Triple, geometryOf } from "./surface.ts";

const HEADER = 16;
const SHAPE = 68;

/** Shapes of `mjvGeom` that are drawn as instances of a mesh of size 1, by their number. */
const SHAPES: Readonly<Record<number, string>> = {
  2: "sphere",
  3: "capsule",
  4: "ellipsoid",
  5: "cylinder",
  6: "box",
  100: "arrow",
  101: "arrow1",
  102: "arrow2",
};
const CAPSULE = 3;
const LINE = 103;
const LINE_BOX = 104;

/** The edges of a box, as pairs of corners; the bits of a corner say on which side it is. */
const BOX_EDGES = [0, 1, 2, 3, 4, 5, 6, 7, 0, 2, 1, 3, 4, 6, 5, 7, 0, 4, 1, 5, 2, 6, 3, 7];

const PLAIN = { rgba: [1, 1, 1, 1], emission: 0, specular: 0.5, shininess: 0.5 } as const;

/** One kind of overlay of a world: the shapes of `@view/overlay/<kind>`, each type as one instanced mesh. */
export class Overlay {
  readonly root = new Group();
  readonly #instances = new Map<number, Instances>();
  readonly #lines = new LineSegments(
    new BufferGeometry(),
    new LineBasicMaterial({ vertexColors: true, transparent: true }),
  );

  constructor(readonly lights: Lights) {
    this.#lines.frustumCulled = false;
    this.#lines.raycast = () => undefined;
    this.root.add(this.#lines);
  }

  /** Number of shapes that are shown. */
  get count(): number {
    let count = this.#lines.geometry.drawRange.count === 0 ? 0 : 1;
    for (const { mesh } of this.#instances.values()) count += mesh.count;
    return count;
  }

  /** Shows the shapes in the bytes of `@view/overlay/<kind>`. */
  apply(payload: DataView<ArrayBuffer>): void {
    const shapes = readShapes(payload);
    for (const type of Object.keys(SHAPES).map(Number)) {
      const found = shapes.filter((candidate) => candidate.type === type);
      if (found.length > 0 || this.#instances.has(type)) this.#of(type, found.length).apply(found);
    }
    this.#drawLines(shapes.filter(({ type }) => type === LINE || type === LINE_BOX));
  }

  dispose(): void {
    this.root.removeFromParent();
    for (const instances of this.#instances.values()) instances.dispose();
    this.#lines.geometry.dispose();
    this.#lines.material.dispose();
  }

  /** Returns the instances of a type with space for a number of shapes. */
  #of(type: number, count: number): Instances {
    const known = this.#instances.get(type);
    if (known !== undefined && known.capacity >= count) return known;
    known?.dispose();
    const made = new Instances(type, Math.max(16, 2 ** Math.ceil(Math.log2(count))), this.lights);
    this.#instances.set(type, made);
    this.root.add(made.mesh);
    return made;
  }

  #drawLines(shapes: readonly Shape[]): void {
    const positions: number[] = [];
    const colors: number[] = [];
    for (const { type, pose, size, rgba } of shapes) {
      const points =
        type === LINE
          ? [
              [0, 0, 0],
              [0, 0, size[2]],
            ]
          : BOX_EDGES.map((bits) => [0, 1, 2].map((axis) => ((bits >> axis) & 1 ? 1 : -1) * size[axis]!));
      for (const [x = 0, y = 0, z = 0] of points) {
        const e = pose.elements;
        positions.push(
          e[0] * x + e[4] * y + e[8] * z + e[12],
          e[1] * x + e[5] * y + e[9] * z + e[13],
          e[2] * x + e[6] * y + e[10] * z + e[14],
        );
        colors.push(...rgba);
      }
    }
    const { geometry } = this.#lines;
    const capacity = geometry.getAttribute("position")?.count ?? 0;
    if (positions.length / 3 > capacity) {
      geometry.dispose();
      const count = 2 * (positions.length / 3);
      geometry.setAttribute("position", new BufferAttribute(new Float32Array(3 * count), 3).setUsage(DynamicDrawUsage));
      geometry.setAttribute("color", new BufferAttribute(new Float32Array(4 * count), 4).setUsage(DynamicDrawUsage));
    }
    this.#lines.visible = positions.length > 0;
    geometry.setDrawRange(0, positions.length / 3);
    if (positions.length === 0) return;
    for (const [name, values] of [
      ["position", positions],
      ["color", colors],
    ] as const) {
      const attribute = geometry.getAttribute(name) as BufferAttribute;
      attribute.array.set(values);
      attribute.needsUpdate = true;
    }
  }
}

/** A shape of an overlay, as MuJoCo's `mjvGeom`. */
export interface Shape {
  readonly type: number;
  readonly pose: Matrix4;
  readonly size: Triple;
  /** From 0 to 1. */
  readonly rgba: readonly [number, number, number, number];
}

/** Reads the shapes in the bytes of `@view/overlay/<kind>`. */
export function readShapes(payload: DataView<ArrayBuffer>): Shape[] {
  const count = payload.getUint32(12, true);
  return Array.from({ length: count }, (_, index) => {
    const start = HEADER + SHAPE * index;
    const number = (field: number) => payload.getFloat32(start + 4 * field, true);
    const byte = (field: number) => payload.getUint8(start + 60 + field) / 255;
    const [x, y, z] = [number(0), number(1), number(2)];
    // prettier-ignore
    const pose = new Matrix4(
      number(3), number(4), number(5), x,
      number(6), number(7), number(8), y,
      number(9), number(10), number(11), z,
      0, 0, 0, 1,
    );
    return {
      type: payload.getUint32(start + 64, true),
      pose,
      size: [number(12), number(13), number(14)],
      rgba: [byte(0), byte(1), byte(2), byte(3)],
    };
  });
}

/** All shapes of one type. */
class Instances {
  readonly mesh: InstancedMesh<BufferGeometry, Shading>;
  readonly #rgba: InstancedBufferAttribute;
  readonly #stretch: InstancedBufferAttribute | null;

  constructor(
    type: number,
    readonly capacity: number,
    lights: Lights,
  ) {
    // Half a capsule's length is not scaled with its radius, so it is an attribute.
    const capsule = type === CAPSULE;
    const unit = shape(SHAPES[type]!, [1, 1, 1], 20)!;
    const geometry = geometryOf(unit, "none");
    this.#rgba = new InstancedBufferAttribute(new Float32Array(4 * capacity), 4).setUsage(DynamicDrawUsage);
    geometry.setAttribute("rgba", this.#rgba);
    this.#stretch = capsule ? new InstancedBufferAttribute(new Float32Array(capacity), 1) : null;
    if (this.#stretch !== null) {
      geometry.setAttribute("stretch", this.#stretch.setUsage(DynamicDrawUsage));
      const ends = unit.positions.filter((_, index) => index % 3 === 2).map(Math.sign);
      geometry.setAttribute("end", new BufferAttribute(ends, 1));
    }
    const shading = new Shading(PLAIN, lights, { instanceColors: true, stretch: capsule });
    this.mesh = new InstancedMesh(geometry, shading, capacity);
    this.mesh.instanceMatrix.setUsage(DynamicDrawUsage);
    this.mesh.frustumCulled = false;
    this.mesh.raycast = () => undefined;
  }

  apply(shapes: readonly Shape[]): void {
    const scaled = new Matrix4();
    let transparent = false;
    shapes.forEach(({ pose, size: [x, y, z], rgba }, index) => {
      const round = this.#stretch !== null;
      scaled.copy(pose).scale({ x, y, z: round ? x : z } as import("three").Vector3);
      this.mesh.setMatrixAt(index, scaled);
      const alpha = 1 - (1 - rgba[3]) ** 2;
      this.#rgba.setXYZW(index, rgba[0], rgba[1], rgba[2], rgba[3] < 0.995 ? alpha : 1);
      // The unit capsule has half a length of 1, in units of the radius.
      this.#stretch?.setX(index, z / (x || 1) - 1);
      transparent ||= rgba[3] < 0.995;
    });
    const { material } = this.mesh;
    if (material.transparent !== transparent) {
      material.transparent = transparent;
      material.depthWrite = !transparent;
      material.needsUpdate = true;
    }
    this.mesh.count = shapes.length;
    this.mesh.instanceMatrix.needsUpdate = true;
    this.#rgba.needsUpdate = true;
    if (this.#stretch !== null) this.#stretch.needsUpdate = true;
  }

  dispose(): void {
    this.mesh.removeFromParent();
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
    this.mesh.dispose();
  }
}
