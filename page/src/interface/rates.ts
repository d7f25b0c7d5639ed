/** Counts events over the last seconds, for example drawn pictures. */
export class Rate {
  readonly #times: number[] = [];

  /** @param span - Wall time that counts [s]. */
  constructor(readonly span = 1) {}

  add(now: number): void {
    this.#times.push(now);
    this.#trim(now);
  }

  /** Returns events per second of wall time. */
  value(now: number): number {
    this.#trim(now);
    return this.#times.length / this.span;
  }

  #trim(now: number): void {
    while (this.#times.length > 0 && this.#times[0]! <= now - this.span) this.#times.shift();
  }
}

interface Mark {
  readonly time: number;
  readonly wallTime: number;
}

/** Measures the speed of a simulation from its frames. */
export class SpeedMeter {
  #marks: Mark[] = [];

  /** @param span - Wall time over which the speed is the mean [s]. */
  constructor(readonly span = 1) {}

  /**
   * @param time - Simulated time of a frame [s].
   * @param wallTime - Wall time of the same frame, by the clock of the server [s].
   */
  add(time: number, wallTime: number): void {
    const last = this.#marks.at(-1);
    if (last !== undefined && (wallTime <= last.wallTime || time < last.time)) {
      if (wallTime === last.wallTime) return;
      // Another run of the server.
      this.#marks = [];
    }
    this.#marks.push({ time, wallTime });
    // The mark just outside the span stays, so that the span is always covered.
    while (this.#marks.length > 2 && this.#marks[1]!.wallTime <= wallTime - this.span) this.#marks.shift();
  }

  clear(): void {
    this.#marks = [];
  }

  /** Returns simulated seconds per second of wall time; null before there are two frames some time apart. */
  get value(): number | null {
    const [first, last] = [this.#marks[0], this.#marks.at(-1)];
    if (first === undefined || last === undefined || last.wallTime - first.wallTime < 0.2 * this.span) return null;
    return (last.time - first.time) / (last.wallTime - first.wallTime);
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
