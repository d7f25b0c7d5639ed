import type { Object3D } from "three";
import type { World } from "../scene/world.ts";
import type { FrameFinder } from "./frames.ts";
import { compose, type Located, type Pose, type Transforms } from "./transforms.ts";

interface Place {
  readonly frame: string;
  /** [s]; null follows the frame. */
  readonly time: number | null;
  done: boolean;
}

/**
 * Places the objects of one topic in the world.
 *
 * A message with a stamp is placed where its frame was at that time; a message without one follows its frame.
 */
export class Placement {
  /** Why an object is not shown; empty if all are. */
  problem = "";
  readonly #places = new Map<Object3D, Place>();
  readonly #implied = new Map<string, { readonly known: string; readonly pose: Pose }>();

  constructor(
    readonly finder: FrameFinder,
    readonly transforms: Transforms,
    readonly world: () => World | undefined,
  ) {}

  set(object: Object3D, frame: string, time: number | null): void {
    const place = { frame, time, done: false };
    this.#places.set(object, place);
    const world = this.world();
    if (world === undefined) object.visible = false;
    else this.#place(world, object, place);
  }

  /** Returns the newest pose of a frame, if it is known. */
  locate(frame: string): Pose | null {
    const world = this.world();
    const located = world === undefined ? "" : this.#find(world, frame, null);
    return typeof located === "string" ? null : located.pose;
  }

  /**
   * Defines a frame by a message that contains its pose.
   *
   * @param pose - Pose of `frame` in the frame `known`.
   */
  imply(frame: string, known: string, pose: Pose): void {
    this.#implied.set(frame, { known, pose });
  }

  delete(object: Object3D): void {
    this.#places.delete(object);
  }

  /** Places the objects whose poses are new or may change. Returns whether one has moved. */
  update(): boolean {
    const world = this.world();
    let moved = false;
    this.problem = world === undefined ? "The model is not loaded yet." : "";
    if (world === undefined) return false;
    for (const [object, place] of this.#places) {
      if (!place.done && this.#place(world, object, place)) moved = true;
    }
    return moved;
  }

  /** Returns whether the object has moved. */
  #place(world: World, object: Object3D, place: Place): boolean {
    const located = this.#find(world, place.frame, place.time);
    if (typeof located === "string") {
      this.problem = located;
      object.visible = false;
      return false;
    }
    const { position, rotation } = located.pose;
    place.done = located.complete;
    if (object.visible && object.position.equals(position) && object.quaternion.equals(rotation)) return false;
    object.position.copy(position);
    object.quaternion.copy(rotation);
    object.visible = true;
    return true;
  }

  #find(world: World, frame: string, time: number | null): Located | string {
    const located = this.finder.find(this.transforms, world, frame, time);
    const implied = this.#implied.get(frame);
    if (typeof located !== "string" || implied === undefined) return located;
    const known = this.finder.find(this.transforms, world, implied.known, time);
    if (typeof known === "string") return located;
    return { pose: compose(known.pose, implied.pose), complete: known.complete };
  }
}
