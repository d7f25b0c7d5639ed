/** Number of frames whose ages are kept. */
const AGES = 120;

/** What the page has received and drawn. */
export interface Statistics {
  /** Frames received. */
  readonly frames: number;
  /** Frames that were drawn; the others were replaced by newer ones. */
  readonly applied: number;
  /** Bytes of frames, overlays and drawing packs. */
  readonly bytes: number;
  /** Pictures drawn. */
  readonly drawn: number;
  /** Of the last picture. */
  readonly draw_calls: number;
  readonly triangles: number;
  /** In the memory of the graphics card. */
  readonly geometries: number;
  readonly textures: number;
  readonly programs: number;
  /** Meshes of all models. */
  readonly meshes: number;
  /** Time from the simulation to the picture [s]; null before the first frame. Clocks of two machines may differ. */
  readonly median_age: number | null;
  /** Time that drawing the last picture took on the page's thread [ms]. */
  readonly draw_time: number;
  /** Name of the graphics card. */
  readonly renderer: string;
}

/** Counts frames and measures their ages. */
export class Counter {
  frames = 0;
  applied = 0;
  bytes = 0;
  drawn = 0;
  drawTime = 0;
  readonly #ages: number[] = [];

  /** Notes a frame that is drawn; times are in s since 1970. */
  age(wallTime: number, now: number): void {
    this.#ages.push(now - wallTime);
    if (this.#ages.length > AGES) this.#ages.shift();
  }

  get medianAge(): number | null {
    const sorted = [...this.#ages].sort((a, b) => a - b);
    return sorted[Math.floor(sorted.length / 2)] ?? null;
  }
}
