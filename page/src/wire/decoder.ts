import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import type { Fields } from "./protocol.ts";
import type { Sample } from "./source.ts";

/** Decodes the samples of one topic. */
export class Decoder {
  readonly #reader: MessageReader<Fields>;

  /** @param definition - ROS message definition with all nested types. */
  constructor(definition: string) {
    this.#reader = new MessageReader<Fields>(parse(definition, { ros2: true }));
  }

  /** Returns the samples of an item: length (uint32), number of lost samples before it (uint32), CDR, padding to 8. */
  samples(payload: DataView<ArrayBuffer>): Sample[] {
    const samples: Sample[] = [];
    for (let at = 0; at + 8 <= payload.byteLength;) {
      const length = payload.getUint32(at, true);
      const cdr = new DataView(payload.buffer, payload.byteOffset + at + 8, length);
      samples.push({ message: this.#reader.readMessage(cdr), lost: payload.getUint32(at + 4, true) });
      at += 8 + length + (-length & 7);
    }
    return samples;
  }
}
