import { Quaternion, Vector3 } from "three";
import type { QuaternionFields, Vector3Fields } from "./messages.ts";

/** A pose, or a transform from a child frame to its parent frame [m]. */
export interface Pose {
  readonly position: Vector3;
  readonly rotation: Quaternion;
}

/** A pose at a time; incomplete if a newer transform may still change it. */
export interface Located {
  readonly pose: Pose;
  readonly complete: boolean;
}

interface Edge {
  readonly parent: string;
  readonly fixed: boolean;
  /** Increasing [s]. */
  readonly times: number[];
  readonly poses: Pose[];
}

/** Transforms are kept for this time [s]. */
const HISTORY = 10;
/** A time that is earlier than the newest by more than this [s] means that the simulation was started again. */
const RESTART = 1;

export function pose(position: Vector3Fields, rotation: QuaternionFields): Pose {
  const { x, y, z, w } = rotation;
  const turned = x === 0 && y === 0 && z === 0 && w === 0 ? new Quaternion() : new Quaternion(x, y, z, w).normalize();
  return { position: new Vector3(position.x, position.y, position.z), rotation: turned };
}

export function identity(): Pose {
  return { position: new Vector3(), rotation: new Quaternion() };
}

/** Returns the pose in the outer frame of something that has the pose `inner` in the frame `outer`. */
export function compose(outer: Pose, inner: Pose): Pose {
  return {
    position: inner.position.clone().applyQuaternion(outer.rotation).add(outer.position),
    rotation: outer.rotation.clone().multiply(inner.rotation),
  };
}

export function inverse({ position, rotation }: Pose): Pose {
  const back = rotation.clone().invert();
  return { position: position.clone().negate().applyQuaternion(back), rotation: back };
}

/** Returns the pose at a time between those that are known; before and after them, the nearest one. */
export function interpolate(times: readonly number[], poses: readonly Pose[], time: number): Pose {
  let low = 0;
  let high = times.length - 1;
  if (time >= times[high]!) return poses[high]!;
  if (time <= times[0]!) return poses[0]!;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    times[middle]! <= time ? (low = middle) : (high = middle);
  }
  const [before, after] = [poses[low]!, poses[high]!];
  const part = (time - times[low]!) / (times[high]! - times[low]!);
  return {
    position: before.position.clone().lerp(after.position, part),
    rotation: before.rotation.clone().slerp(after.rotation, part),
  };
}

/** The tree of frames that `/tf` and `/tf_static` describe, with the transforms of the last seconds. */
export class Transforms {
  readonly #edges = new Map<string, Edge>();

  /** All frames, parents too. */
  get frames(): Set<string> {
    const found = new Set<string>();
    for (const [child, { parent }] of this.#edges) found.add(child).add(parent);
    return found;
  }

  parent(frame: string): string | undefined {
    return this.#edges.get(frame)?.parent;
  }

  has(child: string): boolean {
    return this.#edges.has(child);
  }

  clear(): void {
    this.#edges.clear();
  }

  /** Adds a transform from a frame to its parent; `time` in s. A fixed transform holds at any time. */
  add(parent: string, child: string, time: number, transform: Pose, fixed: boolean): void {
    const edge = this.#edges.get(child);
    const last = edge?.times.at(-1) ?? -Infinity;
    if (edge === undefined || edge.parent !== parent || fixed || edge.fixed || time < last - RESTART) {
      this.#edges.set(child, { parent, fixed, times: [time], poses: [transform] });
      return;
    }
    if (time < last) return;
    if (time === last) {
      edge.poses[edge.poses.length - 1] = transform;
      return;
    }
    edge.times.push(time);
    edge.poses.push(transform);
    const old = edge.times.findIndex((kept) => kept >= time - HISTORY);
    // Removed in groups, because removal at the front moves all others.
    if (old > 100) {
      edge.times.splice(0, old);
      edge.poses.splice(0, old);
    }
  }

  /** Returns the pose of a frame in its parent frame at a time [s]; null is the newest. */
  local(child: string, time: number | null): Located | null {
    const edge = this.#edges.get(child);
    if (edge === undefined) return null;
    const { times, poses, fixed } = edge;
    return {
      pose: interpolate(times, poses, time ?? Infinity),
      complete: fixed || (time !== null && time <= times.at(-1)!),
    };
  }

  /**
   * Returns the pose of a frame in the world.
   *
   * @param anchor - Returns the pose of a frame that is known without transforms, such as a body, or null.
   * @param world - Name of the world frame. If the tree leads to it, anchors are not used.
   */
  find(frame: string, time: number | null, world: string, anchor: (name: string) => Located | null): Located | null {
    return this.#upTo(frame, time, world) ?? this.#toAnchor(frame, time, anchor);
  }

  #upTo(frame: string, time: number | null, world: string): Located | null {
    let located: Located = { pose: identity(), complete: true };
    const seen = new Set<string>();
    for (let at = frame; at !== world;) {
      const step = this.local(at, time);
      if (step === null || seen.has(at)) return null;
      seen.add(at);
      located = { pose: compose(step.pose, located.pose), complete: located.complete && step.complete };
      at = this.parent(at)!;
    }
    return located;
  }

  /** Searches the nearest anchor, up and down the tree. */
  #toAnchor(frame: string, time: number | null, anchor: (name: string) => Located | null): Located | null {
    // The pose of `frame` in each frame that is reached.
    const reached = new Map<string, Located>([[frame, { pose: identity(), complete: true }]]);
    for (const [name, located] of reached) {
      const known = anchor(name);
      if (known !== null) {
        return { pose: compose(known.pose, located.pose), complete: known.complete && located.complete };
      }
      for (const [child, { parent }] of this.#edges) {
        const [next, up] = child === name ? [parent, true] : parent === name ? [child, false] : [name, true];
        if (reached.has(next)) continue;
        const step = this.local(child, time)!;
        const moved = compose(up ? step.pose : inverse(step.pose), located.pose);
        reached.set(next, { pose: moved, complete: located.complete && step.complete });
      }
    }
    return null;
  }
}
