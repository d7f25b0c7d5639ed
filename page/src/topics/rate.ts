/** Time over which a rate is measured [ms of wall time]. */
const WINDOW = 3000;

/** Measures how often something arrives. */
export class Rate {
  readonly #times: number[] = [];

  count(now = performance.now()): void {
    this.#times.push(now);
    while (this.#times[0]! < now - WINDOW) this.#times.shift();
  }

  /** Arrivals per second of wall time; null before the second one, and if none has arrived lately. */
  hertz(now = performance.now()): number | null {
    const recent = this.#times.filter((time) => time >= now - WINDOW);
    const first = recent[0];
    if (first === undefined || recent.length < 2) return null;
    // The time since the last arrival counts only when it is longer than usual.
    const span = Math.max(recent.at(-1)! - first, ((now - first) * (recent.length - 1)) / recent.length);
    return (1000 * (recent.length - 1)) / span;
  }
}
