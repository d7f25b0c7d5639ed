import type { Mesh } from "three";
import type { Shading } from "./shading.ts";

/** Kinds of objects that MuJoCo sorts into groups 0 to 5. */
export const GROUP_KINDS = ["geom", "site", "skin", "flex"] as const;
export type GroupKind = (typeof GROUP_KINDS)[number];

/** Number of groups; MuJoCo counts higher numbers to the last one. */
export const GROUPS = 6;

/** Groups 0 to 2 are visible at first. */
export const VISIBLE_GROUPS = 3;

/** A mesh of a world: the geoms or sites of one body with the same look, a flex, or a skin. */
export interface Part {
  readonly mesh: Mesh<import("three").BufferGeometry, Shading>;
  readonly kind: GroupKind;
  readonly group: number;
  readonly body: number;
  /** Whether the body can move; MuJoCo's transparent mode shows only these as transparent. */
  readonly dynamic: boolean;
  /** Whether it casts a shadow. */
  readonly shadow: boolean;
  /** Index of the first triangle corner of each shape and the id of the shape, in ascending order. */
  readonly shapes: readonly { readonly corner: number; readonly id: number }[];
}

export function clampGroup(group: number): number {
  return Math.max(0, Math.min(GROUPS - 1, group));
}
