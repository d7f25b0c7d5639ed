/** Reads the chunks of a recording; mjplug/view/recording.py writes them. */

const INFO = 0;
const FRAME = 1;
/** Kind and length (uint32), wall time (float64). */
const HEADER = 16;

/** Something that was recorded at a wall time [s since 1970]. */
export interface Recorded {
  readonly time: number;
  readonly payload: DataView<ArrayBuffer>;
}

/** The frames of a few seconds, in order, and the information that holds from a time on. */
export interface Items {
  readonly infos: readonly Recorded[];
  readonly frames: readonly Recorded[];
}

/** A chunk of items that is still compressed. Times are wall times [s since 1970]. */
export interface Chunk {
  readonly from: number;
  readonly to: number;
  read(): Promise<Items>;
}

/** Returns the chunks of a document; a last chunk that was not written completely is left out. */
export function findChunks(document: Document): { items: Chunk[]; scenes: Map<string, () => Promise<ArrayBuffer>> } {
  const items: Chunk[] = [];
  const scenes = new Map<string, () => Promise<ArrayBuffer>>();
  for (const element of document.querySelectorAll<HTMLScriptElement>("script[data-mjplug]")) {
    const text = () => element.textContent ?? "";
    const { mjplug, size, hash, from, to } = element.dataset;
    if (text().length !== Number(size)) continue;
    if (mjplug === "scene") scenes.set(hash ?? "", () => inflate(text()));
    if (mjplug === "items") {
      items.push({ from: Number(from), to: Number(to), read: async () => split(await inflate(text())) });
    }
  }
  return { items, scenes };
}

/** Returns what is compressed with gzip in a text in base64. */
export async function inflate(base64: string): Promise<ArrayBuffer> {
  const bytes = Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

/** Takes the content of a chunk apart. */
export function split(buffer: ArrayBuffer): Items {
  const infos: Recorded[] = [];
  const frames: Recorded[] = [];
  const view = new DataView(buffer);
  for (let at = 0; at + HEADER <= buffer.byteLength;) {
    const kind = view.getUint32(at, true);
    const length = view.getUint32(at + 4, true);
    const item = { time: view.getFloat64(at + 8, true), payload: new DataView(buffer, at + HEADER, length) };
    if (kind === INFO) infos.push(item);
    if (kind === FRAME) frames.push(item);
    at += HEADER + length + (-length & 7);
  }
  return { infos, frames };
}

/** Returns the index of the last entry that is not later than a time; 0 if all are later. */
export function lastBefore(entries: readonly { readonly time: number }[], time: number): number {
  let low = 0;
  let high = entries.length - 1;
  while (low < high) {
    const middle = Math.ceil((low + high) / 2);
    entries[middle]!.time <= time ? (low = middle) : (high = middle - 1);
  }
  return low;
}
