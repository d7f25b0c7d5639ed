import { ConeGeometry, CylinderGeometry, Group, type Material, Mesh, Quaternion, Vector3 } from "three";
import { unpickable } from "./display.ts";

// Of unit size, along x, and shared by all arrows.
const SHAFT = new CylinderGeometry(0.5, 0.5, 1, 16).rotateZ(-Math.PI / 2).translate(0.5, 0, 0);
const HEAD = new ConeGeometry(0.5, 1, 20).rotateZ(-Math.PI / 2).translate(0.5, 0, 0);
const X = new Vector3(1, 0, 0);

/** Sizes of an arrow [m]. */
export interface ArrowSize {
  readonly length: number;
  readonly shaft: number;
  /** Diameter and length of the head. */
  readonly head: number;
  readonly headLength: number;
}

/** Returns an arrow along the x axis, from the origin. */
export function arrow(size: ArrowSize, material: Material): Group {
  const headLength = Math.min(size.headLength, size.length);
  const shaft = unpickable(new Mesh(SHAFT, material));
  shaft.scale.set(Math.max(1e-6, size.length - headLength), size.shaft, size.shaft);
  const head = unpickable(new Mesh(HEAD, material));
  head.position.x = size.length - headLength;
  head.scale.set(Math.max(1e-6, headLength), size.head, size.head);
  const group = new Group();
  group.add(shaft, head);
  return group;
}

/** Returns an arrow of a length [m] with the usual proportions. */
export function plainArrow(length: number, material: Material): Group {
  return arrow({ length, shaft: 0.06 * length, head: 0.16 * length, headLength: 0.28 * length }, material);
}

/** Returns an arrow between two points, with a marker's diameters: `y` of the head and `z` for its length, or 0. */
export function arrowBetween(from: Vector3, to: Vector3, scale: Vector3, material: Material): Group {
  const along = to.clone().sub(from);
  const length = along.length();
  const headLength = scale.z > 0 ? scale.z : 0.23 * length;
  const created = arrow({ length, shaft: scale.x, head: scale.y, headLength }, material);
  created.position.copy(from);
  if (length > 0) created.quaternion.copy(new Quaternion().setFromUnitVectors(X, along.divideScalar(length)));
  return created;
}
