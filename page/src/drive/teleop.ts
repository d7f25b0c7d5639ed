import { type Direction, directionOf, driveKey, speedKey, STOPPED } from "./keymap.ts";

/** What is driven: a base by its velocity, or a joint. */
export interface Target {
  /** Sends the direction; called again at `RATE` until it is zero. */
  send(direction: Direction): void;
  /** Stops at once. */
  stop(): void;
}

/** Messages per second while something moves [Hz]. */
export const RATE = 20;

/** Sticks return to values near the middle, but not exactly to it. */
const DEAD_ZONE = 0.15;

/**
 * Turns keys, sticks and fingers into commands. It sends nothing until it is armed.
 *
 * Everything that may hide a release of a key from the page must call `release` or `disarm`.
 */
export class Teleop {
  readonly #held = new Set<string>();
  #shift = false;
  #touch: Direction = STOPPED;
  #pad: Direction = STOPPED;
  #target: Target | null = null;
  #moving = false;

  /**
   * @param onChange - Called when it is armed or disarmed, and when the direction changes.
   * @param onSpeed - Called with the factors for linear speed and yaw rate when a key changes them.
   */
  constructor(
    readonly onChange: () => void,
    readonly onSpeed: (linear: number, yaw: number) => void,
  ) {}

  get armed(): boolean {
    return this.#target !== null;
  }

  /** The direction of keys, stick and finger together. */
  get direction(): Direction {
    const keys = directionOf(this.#held, this.#shift);
    const sum = (name: keyof Direction) => Math.max(-1, Math.min(1, keys[name] + this.#touch[name] + this.#pad[name]));
    return { x: sum("x"), y: sum("y"), yaw: sum("yaw") };
  }

  arm(target: Target): void {
    this.disarm();
    this.#target = target;
    this.onChange();
  }

  disarm(): void {
    if (this.#target === null) return;
    this.release();
    this.#target = null;
    this.onChange();
  }

  /** Lets go of everything and stops; stays armed. */
  release(): void {
    this.#held.clear();
    this.#shift = false;
    this.#touch = this.#pad = STOPPED;
    this.#target?.stop();
    this.#moving = false;
    this.onChange();
  }

  /** Returns whether the key has a meaning here. */
  keyDown(key: string, shift: boolean): boolean {
    if (!this.armed) return false;
    this.#shift = shift;
    if (key === "Escape") {
      this.disarm();
      return true;
    }
    if (key === " " || key === "k" || key === "K") {
      this.release();
      return true;
    }
    const factors = speedKey(key);
    if (factors !== undefined) {
      this.onSpeed(...factors);
      return true;
    }
    const name = driveKey(key);
    if (name === "") return false;
    this.#held.add(name);
    this.tick();
    return true;
  }

  keyUp(key: string, shift: boolean): void {
    if (!this.armed) return;
    this.#shift = shift;
    if (this.#held.delete(driveKey(key)) || key === "Shift") this.tick();
  }

  /** Sets the direction of the joystick on the screen. */
  touch(direction: Direction): void {
    this.#touch = direction;
    if (this.armed) this.tick();
  }

  /** Sets the direction of a gamepad: left stick forward and turn, right stick to the side. Button 1 stops. */
  gamepad(axes: readonly number[], stop: boolean): void {
    const axis = (index: number) => {
      const value = axes[index] ?? 0;
      return Math.abs(value) < DEAD_ZONE ? 0 : -value;
    };
    this.#pad = stop ? STOPPED : { x: axis(1), y: axis(2), yaw: axis(0) };
    if (stop) this.release();
  }

  /** Sends the direction; call it at `RATE`. */
  tick(): void {
    const { direction } = this;
    const moves = direction.x !== 0 || direction.y !== 0 || direction.yaw !== 0;
    if (this.#target === null) return;
    if (moves) this.#target.send(direction);
    else if (this.#moving) this.#target.stop();
    const changed = moves !== this.#moving;
    this.#moving = moves;
    if (moves || changed) this.onChange();
  }
}
