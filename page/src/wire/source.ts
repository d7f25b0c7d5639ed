import type { Fields, Info, Server, SubscriptionMode } from "./protocol.ts";

/** What a source reports. All are optional, and called on the page's thread. */
export interface SourceListener {
  /** Whether the source delivers, and if not, why. */
  onState?(state: SourceState): void;
  onServers?(servers: readonly Server[]): void;
  onInfo?(server: number, info: Info): void;
  /** The bytes of `@view/frame`. */
  onFrame?(server: number, payload: DataView<ArrayBuffer>): void;
  /** The bytes of `@view/overlay/<kind>`. */
  onOverlay?(server: number, kind: string, payload: DataView<ArrayBuffer>): void;
  /** A message that needs no answer, such as a published one, was refused; one sentence says why. */
  onError?(sentence: string): void;
}

export interface SourceState {
  readonly connected: boolean;
  /** One sentence for the user; empty if all is well. */
  readonly text: string;
}

/** A subscription of the page. */
export interface Subscription {
  readonly type: string;
  close(): void;
}

/** A sample of a topic, decoded. */
export interface Sample {
  readonly message: Fields;
  /** Samples that were dropped before this one, because the page or its link is slow. */
  readonly lost: number;
}

/** An image of a camera, as the relay encoded it. */
export interface Picture {
  readonly file: Blob;
  /** Size of the original image [px]. */
  readonly width: number;
  readonly height: number;
  /** Time stamp of the image [s]. */
  readonly time: number;
}

/**
 * Where poses, topics and services come from: a relay, or a recording.
 *
 * Errors of requests are `Error`s with a sentence for the user.
 */
export interface Source {
  /** Whether it only shows: no drag, no service, no publisher. */
  readonly readOnly: boolean;
  /** Whether it is a recording, which has no topics and services. */
  readonly recorded: boolean;
  readonly servers: readonly Server[];
  /** What is known of each watched server. */
  readonly infos: ReadonlyMap<number, Info>;
  readonly state: SourceState;
  listen(listener: SourceListener): void;
  /** Starts or stops the frames of a server. */
  watch(server: number, on: boolean): void;
  overlay(server: number, kind: string, on: boolean): void;
  /** Returns the drawing pack with this hash, decompressed. */
  scene(hash: string): Promise<ArrayBuffer>;
  /** Tells the source that everything it delivered is drawn; call it after each drawn frame. */
  drawn(): void;
  interfaces(): Promise<import("./protocol.ts").Interfaces>;
  /** `~/name` is the server's own. */
  call(server: number, service: string, request?: Fields): Promise<Fields>;
  /** With `stop`, the relay publishes that message when the page stays silent for `timeout` [s] or leaves. */
  publish(server: number, topic: string, type: string, message: Fields, stop?: Fields, timeout?: number): void;
  /** Sends a drag as described in docs/wire.md, or releases it. Repeat it at 10 Hz or more. */
  drag(server: number, drag: Drag | null): void;
  subscribe(
    topic: string,
    mode: Exclude<SubscriptionMode, "image">,
    onSamples: (samples: Sample[]) => void,
  ): Promise<Subscription>;
  subscribeImages(topic: string, onPicture: (picture: Picture) => void): Promise<Subscription>;
}

export interface Drag {
  readonly body: number;
  /** Dragged point in the body's frame [m]. */
  readonly local: readonly [number, number, number];
  /** In the world frame [m]. */
  readonly target?: readonly [number, number, number];
  /** Orientation to turn to, w first. */
  readonly rotate?: readonly [number, number, number, number];
}
