import type { Picture, Sample, Source, Subscription } from "../wire/source.ts";

/** A subscription that can be closed at any time, also before the relay has answered. */
export class Live {
  #subscription: Subscription | null = null;
  #closed = false;

  constructor(opening: Promise<Subscription>, onError: (sentence: string) => void) {
    opening.then(
      (subscription) => (this.#closed ? subscription.close() : (this.#subscription = subscription)),
      (error: Error) => this.#closed || onError(error.message),
    );
  }

  get type(): string {
    return this.#subscription?.type ?? "";
  }

  close(): void {
    this.#closed = true;
    this.#subscription?.close();
    this.#subscription = null;
  }
}

/** Subscribes to messages; nothing is delivered after `close`. */
export function samples(
  source: Source,
  topic: string,
  mode: "newest" | "all",
  onSamples: (samples: Sample[]) => void,
  onError: (sentence: string) => void,
): Live {
  const live: Live = new Live(source.subscribe(topic, mode, onSamples), onError);
  return live;
}

export function pictures(
  source: Source,
  topic: string,
  onPicture: (picture: Picture) => void,
  onError: (sentence: string) => void,
): Live {
  return new Live(source.subscribeImages(topic, onPicture), onError);
}
