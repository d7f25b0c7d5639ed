interface Mark {
  readonly value: number;
  readonly wallTime: number;
}

/** Measures the slope of a quantity over the last second: simulated time, or pictures drawn. */
export class Meter {
  #marks: Mark[] = [];

  /** @param span - Wall time over which the slope is the mean [s]. */
  constructor(readonly span = 1) {}

  /**
   * @param value - The quantity, which does not decrease.
   * @param wallTime - When it had this value [s], by the clock of the machine that measured it.
   */
  add(value: number, wallTime: number): void {
    const last = this.#marks.at(-1);
    if (last !== undefined && (wallTime <= last.wallTime || value < last.value)) {
      if (wallTime === last.wallTime) return;
      // The server has started again.
      this.#marks = [];
    }
    this.#marks.push({ value, wallTime });
    // The mark just outside the span stays, so that the span is always covered.
    while (this.#marks.length > 2 && this.#marks[1]!.wallTime <= wallTime - this.span) this.#marks.shift();
  }

  clear(): void {
    this.#marks = [];
  }

  /** Returns the slope [1/s]; null before there are two values some time apart. */
  get value(): number | null {
    const [first, last] = [this.#marks[0], this.#marks.at(-1)];
    if (first === undefined || last === undefined || last.wallTime - first.wallTime < 0.2 * this.span) return null;
    return (last.value - first.value) / (last.wallTime - first.wallTime);
  }
}

/** Measures how old pictures are when they are drawn, although the clock of the server may differ. */
export class AgeMeter {
  #offset = Infinity;

  /** Returns the age of a frame [s]: at `now` by the clock of the browser, made at `wallTime` by that of the server. */
  age(wallTime: number, now: number): number {
    const age = now - wallTime;
    this.#offset = Math.min(this.#offset, age);
    // Clocks that agree show an age of at least 0 and not many seconds; otherwise the fastest frame counts as new.
    return this.#offset >= 0 && this.#offset < 2 ? age : age - this.#offset;
  }
}
