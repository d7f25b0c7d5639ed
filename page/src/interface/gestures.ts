/** What a press of the mouse or a finger begins. */
export type DragKind = "pull" | "turn";
/** What a plain drag on a body does. */
export type DragMode = "off" | DragKind;

/** The part of a pointer event that decides what it begins. */
export interface Press {
  /** 0 is the left button, a finger or a pen; 2 is the right button. */
  readonly button: number;
  readonly ctrlKey: boolean;
  readonly metaKey: boolean;
}

/**
 * Returns what a press begins; null leaves it to the camera.
 *
 * As in MuJoCo's `simulate`, Ctrl with the right button pulls and with the left one turns. On a Mac, where Ctrl with a click is
 * itself a right click, Command pulls.
 *
 * @param mode - What a press without a key on a body does.
 * @param onBody - Whether a body that can move is under the pointer.
 */
export function dragKind({ button, ctrlKey, metaKey }: Press, mode: DragMode, onBody: boolean): DragKind | null {
  if (metaKey && button === 0) return "pull";
  if (ctrlKey && button === 2) return "pull";
  if (ctrlKey && button === 0) return "turn";
  return mode !== "off" && button === 0 && onBody ? mode : null;
}

/** Finds presses that stay in place for a while. */
export class LongPress {
  #timer: ReturnType<typeof setTimeout> | null = null;
  #x = 0;
  #y = 0;

  /**
   * @param duration - How long the press must stay [ms].
   * @param tolerance - How far it may move [px].
   */
  constructor(
    readonly duration = 500,
    readonly tolerance = 10,
  ) {}

  start(x: number, y: number, found: () => void): void {
    this.cancel();
    [this.#x, this.#y] = [x, y];
    this.#timer = setTimeout(() => {
      this.#timer = null;
      found();
    }, this.duration);
  }

  move(x: number, y: number): void {
    if (Math.hypot(x - this.#x, y - this.#y) > this.tolerance) this.cancel();
  }

  cancel(): void {
    if (this.#timer !== null) clearTimeout(this.#timer);
    this.#timer = null;
  }
}
