import type { Fields, Info, Interfaces, Server } from "../wire/protocol.ts";
import type { Source, SourceListener, SourceState, Subscription } from "../wire/source.ts";
import { type Chunk, findChunks, type Items, lastBefore, type Recorded } from "./chunks.ts";

const SERVER = 0;
/** Chunks that stay decompressed. */
const CACHED = 8;

/** A source that plays a recording, which is in the page itself. */
export class Recording implements Source {
  readonly readOnly = true;
  readonly recorded = true;
  readonly infos = new Map<number, Info>();
  readonly servers: readonly Server[];
  readonly state: SourceState;
  /** Wall time from the first to the last frame [s]. */
  readonly duration: number;
  /** Recorded seconds per second; 1 is the speed at which the server was recorded. */
  rate = 1;
  playing = true;
  readonly #listeners: SourceListener[] = [];
  readonly #chunks: readonly (Chunk & { readonly time: number })[];
  readonly #scenes: ReadonlyMap<string, () => Promise<ArrayBuffer>>;
  readonly #items = new Map<number, Promise<Items>>();
  #position = 0;
  #frame: Recorded | null = null;
  #info: Recorded | null = null;

  /**
   * @param about - The JSON at the start of the recording.
   * @param document - The document with the chunks.
   */
  constructor(about: string, document: Document) {
    const { items, scenes } = findChunks(document);
    this.#chunks = items.map((chunk) => ({ ...chunk, time: chunk.from }));
    this.#scenes = scenes;
    this.duration = items.length === 0 ? 0 : items.at(-1)!.to - items[0]!.from;
    this.servers = [{ id: SERVER, name: (JSON.parse(about) as { server: string }).server, connected: true }];
    const empty = items.length === 0 || scenes.size === 0;
    this.state = empty
      ? { connected: false, text: "This recording contains no frames." }
      : { connected: true, text: "" };
    if (empty) this.playing = false;
  }

  /** The position in the recording [s]. */
  get position(): number {
    return this.#position;
  }

  listen(listener: SourceListener): void {
    this.#listeners.push(listener);
  }

  watch(_server: number, on: boolean): void {
    if (on) void this.#show();
  }

  /** Goes on by some time of the page [s]; ends at the last frame. Resolves when the new position is shown. */
  async advance(seconds: number): Promise<void> {
    if (!this.playing) return;
    if (this.#position >= this.duration) this.playing = false;
    else await this.seek(this.#position + this.rate * seconds);
  }

  /** Shows a position [s]. Resolves when it is shown, or another one has been asked for meanwhile. */
  async seek(position: number): Promise<void> {
    this.#position = Math.min(this.duration, Math.max(0, position));
    await this.#show();
  }

  /** Shows the frame before or after the present one. */
  async step(direction: -1 | 1): Promise<void> {
    this.playing = false;
    const frame = this.#frame;
    if (frame === null) return;
    const index = this.#chunkAt(frame.time);
    const chunks = await Promise.all([index - 1, index, index + 1].map((each) => this.#read(each)));
    const frames = chunks.flatMap((items) => items?.frames ?? []);
    const next = frames[frames.findIndex(({ time }) => time === frame.time) + direction];
    if (next !== undefined) await this.seek(next.time - this.#chunks[0]!.from);
  }

  /** Delivers the present frame again, for a scene that has just been loaded. */
  refresh(): void {
    this.#frame = null;
    void this.#show();
  }

  async scene(hash: string): Promise<ArrayBuffer> {
    const read = this.#scenes.get(hash);
    if (read === undefined) throw new Error("The recording does not contain the model.");
    return read();
  }

  drawn(): void {}

  overlay(): void {}

  async interfaces(): Promise<Interfaces> {
    return { topics: [], services: [] };
  }

  call(): Promise<Fields> {
    return Promise.reject(new Error("This is a recording, so there is no server to ask."));
  }

  publish(): void {}

  drag(): void {}

  subscribe(): Promise<Subscription> {
    return Promise.reject(new Error("A recording contains no topics."));
  }

  subscribeImages(): Promise<Subscription> {
    return this.subscribe();
  }

  async #show(): Promise<void> {
    const first = this.#chunks[0];
    if (first === undefined) return;
    // A little later, so that rounding does not show the frame before.
    const time = first.from + this.#position + 1e-6;
    const index = this.#chunkAt(time);
    const items = await this.#read(index);
    // Read before it is needed, so that playing does not stop.
    void this.#read(index + 1);
    if (items === null || this.#chunkAt(first.from + this.#position + 1e-6) !== index) return;
    const now = first.from + this.#position + 1e-6;
    const info = items.infos[lastBefore(items.infos, now)];
    if (info !== undefined && info !== this.#info) this.#deliverInfo(info);
    const frame = items.frames[lastBefore(items.frames, now)];
    if (frame === undefined || frame === this.#frame) return;
    this.#frame = frame;
    for (const listener of this.#listeners) listener.onFrame?.(SERVER, frame.payload);
  }

  #deliverInfo(recorded: Recorded): void {
    this.#info = recorded;
    const info = JSON.parse(new TextDecoder().decode(recorded.payload)) as Info;
    this.infos.set(SERVER, info);
    for (const listener of this.#listeners) listener.onInfo?.(SERVER, info);
  }

  #chunkAt(time: number): number {
    return lastBefore(this.#chunks, time);
  }

  #read(index: number): Promise<Items | null> {
    const chunk = this.#chunks[index];
    if (chunk === undefined) return Promise.resolve(null);
    const items = this.#items.get(index) ?? chunk.read();
    // The last one that was used is the last one of the map.
    this.#items.delete(index);
    this.#items.set(index, items);
    if (this.#items.size > CACHED) this.#items.delete(this.#items.keys().next().value!);
    return items.catch(() => null);
  }
}
