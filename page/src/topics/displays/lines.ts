import { type Color, Object3D } from "three";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/addons/lines/LineSegmentsGeometry.js";
import { unpickable } from "./display.ts";

/** Straight lines with a width. */
export class Lines {
  readonly object: Object3D;
  readonly #lines: LineSegments2;

  /** @param width - In m with `world`, else in CSS pixels. */
  constructor(options: { readonly colour?: Color; readonly width: number; readonly world?: boolean }) {
    const { colour, width, world } = options;
    const material = new LineMaterial({
      linewidth: width,
      worldUnits: world ?? false,
      vertexColors: colour === undefined,
    });
    if (colour !== undefined) material.color.copy(colour);
    this.#lines = unpickable(new LineSegments2(new LineSegmentsGeometry(), material));
    this.#lines.frustumCulled = false;
    this.#lines.visible = false;
    // Only the inner object is hidden while there is no line, because the placement shows and hides the outer one.
    this.object = new Object3D();
    this.object.add(this.#lines);
  }

  /**
   * @param segments - 6 numbers for each line: its two ends [m].
   * @param colours - 6 numbers from 0 to 1 for each line; without them, the lines have the colour of the constructor.
   */
  set(segments: Float32Array | number[], colours?: Float32Array | number[]): void {
    const count = segments.length / 6;
    this.#lines.visible = count > 0;
    if (count === 0) return;
    const geometry = new LineSegmentsGeometry();
    geometry.setPositions(segments);
    if (colours !== undefined) geometry.setColors(colours);
    this.#lines.geometry.dispose();
    this.#lines.geometry = geometry;
  }

  set opacity(value: number) {
    this.#lines.material.transparent = value < 1;
    this.#lines.material.opacity = value;
  }

  dispose(): void {
    this.object.removeFromParent();
    this.#lines.geometry.dispose();
    this.#lines.material.dispose();
  }
}

/** Returns the segments of a line through points, 3 numbers each. */
export function strip(points: ArrayLike<number>): Float32Array {
  const count = Math.max(0, points.length / 3 - 1);
  const segments = new Float32Array(6 * count);
  for (let index = 0; index < count; index += 1) {
    for (let part = 0; part < 6; part += 1) segments[6 * index + part] = points[3 * index + part]!;
  }
  return segments;
}
