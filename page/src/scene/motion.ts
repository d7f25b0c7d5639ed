import type { Frame } from "./frame.ts";

/** Frames that are further apart in wall time are not joined by a motion [s]. */
const MAX_GAP = 0.25;

/** The poses that are shown: those of the newest frame, or between the last frames on the way to it. */
export class Motion {
  /** The newest frame. */
  frame: Frame | null = null;
  #shown: Float32Array[] = [];
  #from: Float32Array[] = [];
  #start = 0;
  #duration = 0;
  #moving = false;

  /** Whether the poses still change without a new frame. */
  get moving(): boolean {
    return this.#moving;
  }

  /** 7 numbers for each moving body. */
  get bodies(): Float32Array {
    return this.#shown[0] ?? EMPTY;
  }

  /** 12 numbers for each camera. */
  get cameras(): Float32Array {
    return this.#shown[1] ?? EMPTY;
  }

  /** 3 numbers for each flex vertex. */
  get vertices(): Float32Array {
    return this.#shown[2] ?? EMPTY;
  }

  /**
   * Takes a frame.
   *
   * @param now - Wall time of the page [s].
   * @param smooth - Whether to move to it rather than to jump.
   */
  push(frame: Frame, now: number, smooth: boolean): void {
    const last = this.frame;
    this.frame = frame;
    const gap = last === null ? 0 : frame.wallTime - last.wallTime;
    // Two frames may come before the first one has been shown; there is nothing to move from then.
    const continuous =
      last !== null &&
      this.#shown.length > 0 &&
      frame.epoch === last.epoch &&
      frame.time > last.time &&
      frame.bodies.length === last.bodies.length &&
      frame.vertices.length === last.vertices.length &&
      gap > 0 &&
      gap < MAX_GAP;
    this.#moving = true;
    this.#start = now;
    if (continuous && smooth) {
      this.#from = this.#shown.map((values) => values.slice());
      this.#duration = gap;
    } else {
      this.#duration = 0;
    }
  }

  /** Computes the poses to show at a wall time of the page [s]; returns whether they have changed. */
  advance(now: number): boolean {
    if (!this.#moving || this.frame === null) return false;
    const { bodies, cameras, vertices } = this.frame;
    const weight = this.#duration > 0 ? (now - this.#start) / this.#duration : 1;
    if (weight >= 1) {
      this.#shown = [bodies, cameras, vertices];
      this.#moving = false;
      return true;
    }
    const [fromBodies, fromCameras, fromVertices] = this.#from as [Float32Array, Float32Array, Float32Array];
    this.#shown = [
      mixPoses(fromBodies, bodies, weight),
      mix(fromCameras, cameras, weight),
      mix(fromVertices, vertices, weight),
    ];
    return true;
  }
}

const EMPTY = new Float32Array(0);

function mix(from: Float32Array, to: Float32Array, weight: number): Float32Array {
  return to.map((value, index) => from[index]! + weight * (value - from[index]!));
}

/** Mixes positions, and quaternions along the shorter way; frames are so close that their length is restored only. */
export function mixPoses(from: Float32Array, to: Float32Array, weight: number): Float32Array {
  const mixed = mix(from, to, weight);
  for (let start = 3; start < to.length; start += 7) {
    let dot = 0;
    for (let index = start; index < start + 4; index += 1) dot += from[index]! * to[index]!;
    const sign = dot < 0 ? -1 : 1;
    let square = 0;
    for (let index = start; index < start + 4; index += 1) {
      mixed[index] = sign * from[index]! * (1 - weight) + to[index]! * weight;
      square += mixed[index]! ** 2;
    }
    for (let index = start; index < start + 4; index += 1) mixed[index]! /= Math.sqrt(square);
  }
  return mixed;
}
