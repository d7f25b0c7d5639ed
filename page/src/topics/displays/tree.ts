import type { Sprite, Vector3 } from "three";
import { slider, toggle, type Control } from "../../interface/controls.ts";
import type { Pose } from "../transforms.ts";
import { Axes } from "./axes.ts";
import type { Display, DisplayContext } from "./display.ts";
import { disposeLabel, label } from "./label.ts";

/** More frames are not drawn, because nobody could tell them apart. */
const MOST = 500;

/** The tree of frames of `/tf` and `/tf_static`: axes, names, and lines to the parents. */
export class TreeDisplay implements Display {
  readonly #axes = new Axes();
  readonly #labels = new Map<string, Sprite>();
  #count = 0;
  #drawn = "";

  constructor(readonly context: DisplayContext) {
    context.group.add(this.#axes.object);
  }

  show(): void {
    // The transforms come by the subscription that all displays share.
  }

  update(): boolean {
    const { transforms, placement } = this.context;
    const poses = new Map<string, Pose>();
    const links: (readonly [Vector3, Vector3])[] = [];
    for (const frame of [...transforms.frames].slice(0, MOST)) {
      const pose = placement.locate(frame);
      if (pose !== null) poses.set(frame, pose);
    }
    const size = this.context.option("size", 0.15);
    const names = this.context.option("names", true);
    const state = [...poses].map(([frame, { position, rotation }]) => [frame, ...position, ...rotation].join(" "));
    const drawn = [size, names, ...state].join("\n");
    if (drawn === this.#drawn) return false;
    this.#drawn = drawn;
    for (const [frame, { position }] of poses) {
      const parent = poses.get(transforms.parent(frame) ?? "");
      if (parent !== undefined) links.push([position, parent.position]);
    }
    this.#axes.set([...poses.values()], size, links);
    this.#label(names ? poses : new Map<string, Pose>(), size);
    this.#count = poses.size;
    return true;
  }

  summary(): string {
    const { size } = this.context.transforms.frames;
    return this.#count === size ? `${size} frames` : `${this.#count} of ${size} frames`;
  }

  controls(): Control[] {
    const { context } = this;
    return [
      toggle({
        text: "Names",
        value: context.option("names", true),
        change: (value) => context.setOption("names", value),
      }),
      slider({
        label: "Axes",
        unit: "m",
        min: 0.02,
        max: 1,
        step: 0.01,
        decimals: 2,
        value: context.option("size", 0.15),
        change: (value) => context.setOption("size", value),
      }),
    ];
  }

  dispose(): void {
    this.#axes.dispose();
    for (const sprite of this.#labels.values()) disposeLabel(sprite);
  }

  #label(poses: ReadonlyMap<string, Pose>, size: number): void {
    for (const [frame, sprite] of this.#labels) {
      if (poses.has(frame)) continue;
      disposeLabel(sprite);
      this.#labels.delete(frame);
    }
    for (const [frame, pose] of poses) {
      let sprite = this.#labels.get(frame);
      if (sprite === undefined) {
        sprite = label(frame, { colour: "#ffffff", ground: "rgb(20 24 30 / 0.65)" });
        sprite.center.set(0.5, -0.15);
        this.#labels.set(frame, sprite);
        this.context.group.add(sprite);
      }
      sprite.position.copy(pose.position);
      sprite.position.z += 0.1 * size;
    }
  }
}
