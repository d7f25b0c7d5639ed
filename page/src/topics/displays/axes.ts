import { Vector3 } from "three";
import type { Pose } from "../transforms.ts";
import { Lines } from "./lines.ts";

/** x red, y green, z blue. */
const COLOURS = [
  [0.9, 0.2, 0.2],
  [0.2, 0.75, 0.25],
  [0.25, 0.45, 1],
] as const;

/** Coordinate axes of any number of frames, and lines between them. */
export class Axes {
  readonly #lines = new Lines({ width: 3 });

  get object(): Lines["object"] {
    return this.#lines.object;
  }

  /**
   * @param size - Length of an axis [m].
   * @param links - Pairs of points to connect with thin yellow lines.
   */
  set(poses: readonly Pose[], size: number, links: readonly (readonly [Vector3, Vector3])[] = []): void {
    const segments: number[] = [];
    const colours: number[] = [];
    const add = (from: Vector3, to: Vector3, colour: readonly [number, number, number]) => {
      segments.push(from.x, from.y, from.z, to.x, to.y, to.z);
      colours.push(...colour, ...colour);
    };
    for (const { position, rotation } of poses) {
      COLOURS.forEach((colour, axis) => {
        const end = new Vector3().setComponent(axis, size).applyQuaternion(rotation).add(position);
        add(position, end, colour);
      });
    }
    for (const [from, to] of links) add(from, to, [0.85, 0.7, 0.1]);
    this.#lines.set(segments, colours);
  }

  dispose(): void {
    this.#lines.dispose();
  }
}
