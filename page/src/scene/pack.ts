import type { Info } from "../wire/protocol.ts";

/** A number array in the pack. */
export interface ArrayEntry {
  readonly offset: number;
  readonly type: "f4" | "i1" | "u2" | "u4";
  readonly shape: readonly number[];
}

type Vector = readonly number[];

export interface BodyEntry {
  readonly name: string;
  readonly parent: number;
  readonly root: number;
  readonly pos: Vector;
  /** w first */
  readonly quat: Vector;
  /** [kg] */
  readonly mass: number;
  readonly mocap: boolean;
}

export interface GeomEntry {
  readonly id: number;
  readonly name: string;
  readonly body: number;
  readonly type: string;
  readonly size: Vector;
  readonly pos: Vector;
  readonly quat: Vector;
  readonly rgba: Vector;
  readonly material: number;
  readonly group: number;
  readonly mesh?: number;
  readonly hfield?: number;
}

/** The header of a drawing pack; docs/wire.md describes it, mjplug/services/view/pack.py writes it. */
export interface PackHeader extends Pick<Info, "joints" | "actuators" | "keyframes"> {
  readonly name: string;
  readonly mujoco: string;
  readonly bodies: readonly BodyEntry[];
  /** Ids of the bodies whose poses are in the frames. */
  readonly moving: readonly number[];
  readonly geoms: readonly GeomEntry[];
  readonly stat: { readonly center: Vector; readonly extent: number };
}

/** A drawing pack: everything but the poses that is needed to draw a model. */
export class Pack {
  readonly header: PackHeader;
  readonly #start: number;

  /** @throws Error if the buffer is no drawing pack. */
  constructor(readonly buffer: ArrayBuffer) {
    const view = new DataView(buffer);
    const magic = new TextDecoder().decode(new Uint8Array(buffer, 0, Math.min(4, buffer.byteLength)));
    if (magic !== "MJV1") {
      throw new Error(`The model cannot be read: it starts with "${magic}" instead of "MJV1".`);
    }
    const length = view.getUint32(4, true);
    this.header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 8, length)));
    this.#start = 8 + length + (-(8 + length) & 7);
  }

  /** Returns an array of the pack, without a copy. */
  array(entry: ArrayEntry): Float32Array | Int8Array | Uint16Array | Uint32Array {
    const Type = { f4: Float32Array, i1: Int8Array, u2: Uint16Array, u4: Uint32Array }[entry.type];
    return new Type(
      this.buffer,
      this.#start + entry.offset,
      entry.shape.reduce((a, b) => a * b, 1),
    );
  }

  /** Returns a file of the pack, such as a PNG image. */
  file(entry: { readonly offset: number; readonly size: number }): Uint8Array<ArrayBuffer> {
    return new Uint8Array(this.buffer, this.#start + entry.offset, entry.size);
  }
}
