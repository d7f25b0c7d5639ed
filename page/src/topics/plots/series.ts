/** The samples of one plotted field. The newest samples are kept; NaN marks samples that were lost before the next one. */
export class Series {
  /** Number of samples that were lost since the start. */
  lost = 0;
  #times: Float64Array<ArrayBuffer>;
  #values: Float64Array<ArrayBuffer>;
  #start = 0;
  #end = 0;

  /** @param most - Maximum number of samples. */
  constructor(readonly most = 20_000) {
    // Twice the room: the samples are moved to the front when the end is reached, so that views need no copy.
    this.#times = new Float64Array(2 * most);
    this.#values = new Float64Array(2 * most);
  }

  get length(): number {
    return this.#end - this.#start;
  }

  /** Times [s], increasing; valid until the next `add`. */
  get times(): Float64Array {
    return this.#times.subarray(this.#start, this.#end);
  }

  get values(): Float64Array {
    return this.#values.subarray(this.#start, this.#end);
  }

  /** Adds a sample. A time before the last one means that the simulation was started again; then all samples are dropped. */
  add(time: number, value: number, lost = 0): void {
    const last = this.#end > this.#start ? this.#times[this.#end - 1]! : -Infinity;
    if (time < last) this.clear();
    if (lost > 0) {
      this.lost += lost;
      if (this.length > 0) this.#push((last + time) / 2, NaN);
    }
    this.#push(time, value);
  }

  clear(): void {
    this.#start = this.#end = 0;
  }

  #push(time: number, value: number): void {
    if (this.#end === this.#times.length) {
      this.#times.copyWithin(0, this.#start, this.#end);
      this.#values.copyWithin(0, this.#start, this.#end);
      this.#end -= this.#start;
      this.#start = 0;
    }
    this.#times[this.#end] = time;
    this.#values[this.#end] = value;
    this.#end += 1;
    if (this.#end - this.#start > this.most) this.#start += 1;
  }
}

/** Columns for a plot: times, and for each series its values; undefined where it has no sample at that time. */
export interface Columns {
  readonly times: number[];
  readonly values: (number | null | undefined)[][];
}

/** Merges series into columns with common times, from a time on [s]. A null is a gap; undefined is none. */
export function merge(series: readonly { times: Float64Array; values: Float64Array }[], from = -Infinity): Columns {
  const times: number[] = [];
  const values: (number | null | undefined)[][] = series.map(() => []);
  const at = series.map((one) => firstFrom(one.times, from));
  for (;;) {
    let time = Infinity;
    series.forEach((one, index) => (time = Math.min(time, one.times[at[index]!] ?? Infinity)));
    if (time === Infinity) return { times, values };
    times.push(time);
    series.forEach((one, index) => {
      const column = values[index]!;
      if (one.times[at[index]!] !== time) {
        column.push(undefined);
        return;
      }
      // Of several samples at one time, the newest is shown.
      while (one.times[at[index]! + 1] === time) at[index]! += 1;
      const value = one.values[at[index]!]!;
      column.push(Number.isFinite(value) ? value : null);
      at[index]! += 1;
    });
  }
}

function firstFrom(times: Float64Array, from: number): number {
  let low = 0;
  let high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    times[middle]! < from ? (low = middle + 1) : (high = middle);
  }
  return low;
}

/** Returns a table for spreadsheets: a column of times, and a column for each series; empty where it has no sample. */
export function toCsv(names: readonly string[], { times, values }: Columns): string {
  const lines = [["time [s]", ...names].map(quote).join(",")];
  times.forEach((time, row) => {
    const cells = values.map((column) => column[row] ?? "");
    // Rows that only mark lost samples are left out.
    if (cells.some((cell) => cell !== "")) lines.push([roundTime(time), ...cells].join(","));
  });
  return `${lines.join("\r\n")}\r\n`;
}

/** Removes the error of adding seconds and nanoseconds. */
function roundTime(time: number): number {
  return Math.round(1e9 * time) / 1e9;
}

function quote(text: string): string {
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}
