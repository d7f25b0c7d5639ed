import { type Object3D, Color } from "three";
import type { Control } from "../../interface/controls.ts";
import type { Fields } from "../../wire/protocol.ts";
import type { Placement } from "../placement.ts";
import type { Transforms } from "../transforms.ts";

/** What a display gets from its layer. */
export interface DisplayContext {
  /** Where the display adds its objects. */
  readonly group: Object3D;
  readonly placement: Placement;
  readonly transforms: Transforms;
  /** A colour of its own for this topic. */
  readonly colour: Color;
  /** Simulated time of the newest frame [s]; null before the first. */
  now(): number | null;
  /** Returns an option that the user chose before, or `fallback`. */
  option<T extends string | number | boolean>(name: string, fallback: T): T;
  /** Keeps an option and draws again. */
  setOption(name: string, value: string | number | boolean): void;
}

/** Draws the messages of one topic. */
export interface Display {
  /** Whether it needs every message. Otherwise, only the newest one is delivered. */
  readonly all?: boolean;
  /** Shows a message. @throws Error with a sentence if it cannot be shown. */
  show(message: Fields): void;
  /** Called before each drawing; returns whether to draw. */
  update?(): boolean;
  /** What is shown, such as "360 points". */
  summary?(): string;
  /** Controls for the options. */
  controls?(): Control[];
  dispose(): void;
}

/** Colours that differ from each other on light and dark ground, also for colour-blind readers (Okabe and Ito). */
export const PALETTE = ["#e69f00", "#56b4e9", "#009e73", "#d55e00", "#cc79a7", "#0072b2", "#f0e442"] as const;

export function paletteColour(index: number): string {
  return PALETTE[index % PALETTE.length]!;
}

/** An object that the mouse does not select, because only bodies can be selected. */
export function unpickable<T extends Object3D>(object: T): T {
  object.raycast = () => undefined;
  return object;
}
