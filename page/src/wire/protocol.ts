/** The messages between `mjplug view` and its page; mjplug/view/protocol.py describes the other end. */

/** A server as the relay reports it. The same name keeps its id when it returns. */
export interface Server {
  readonly id: number;
  readonly name: string;
  readonly connected: boolean;
}

export interface JointInfo {
  readonly name: string;
  readonly type: "free" | "ball" | "slide" | "hinge";
  readonly body: number;
  /** Limits in rad or m; null means unlimited. */
  readonly range: readonly [number, number] | null;
}

export interface ActuatorInfo {
  readonly name: string;
  /** Limits of each control, in the actuator's unit. */
  readonly controls: readonly (readonly [number, number] | null)[];
  /** Id of the joint that it acts on, if it acts on one. */
  readonly joint?: number | null;
}

/** `@view/info` of a server. */
export interface Info {
  readonly name: string;
  /** Hash of the drawing pack, which is at `scene/<hash>`. */
  readonly scene: string;
  readonly scene_bytes: number;
  /** [s] */
  readonly timestep: number;
  /** Number of resets. */
  readonly epoch: number;
  readonly step: number;
  readonly paused: boolean;
  /** Requested speed relative to real time, or "max". */
  readonly speed: number | "max";
  /** Type of each plugin instance, by instance name. */
  readonly plugins: Readonly<Record<string, string>>;
  readonly bodies: readonly string[];
  readonly joints: readonly JointInfo[];
  readonly actuators: readonly ActuatorInfo[];
  readonly cameras: readonly string[];
  readonly keyframes: readonly string[];
}

export interface TopicEntry {
  readonly name: string;
  readonly type: string;
  readonly publishers: number;
  readonly subscribers: number;
  readonly server: number;
}

export interface ServiceEntry {
  readonly name: string;
  readonly type: string;
  readonly server: number;
}

export interface Interfaces {
  readonly topics: readonly TopicEntry[];
  readonly services: readonly ServiceEntry[];
}

/** newest: the newest sample of each batch; all: every sample; image: JPEG made by the relay. */
export type SubscriptionMode = "newest" | "all" | "image";

export interface Subscribed {
  readonly channel: number;
  readonly type: string;
  /** ROS message definition with all nested types, separated by lines of `=`. */
  readonly definition: string;
}

export type Fields = { readonly [name: string]: unknown };

/** What the page sends; with `id`, the relay replies. */
export type Request =
  | { readonly op: "watch"; readonly server: number; readonly on: boolean }
  | { readonly op: "overlay"; readonly server: number; readonly kind: OverlayKind; readonly on: boolean }
  | { readonly op: "topics" }
  | { readonly op: "subscribe"; readonly topic: string; readonly mode: SubscriptionMode }
  | { readonly op: "unsubscribe"; readonly channel: number }
  | { readonly op: "definition"; readonly type: string }
  | { readonly op: "call"; readonly service: string; readonly request: Fields; readonly server?: number }
  | {
      readonly op: "publish";
      readonly topic: string;
      readonly message: Fields;
      readonly type?: string;
      /** Published by the relay when the page does not publish again within `timeout` [s of wall time] or leaves. */
      readonly stop?: Fields;
      readonly timeout?: number;
      readonly server?: number;
    }
  | { readonly op: "drag"; readonly server: number; readonly release: true }
  | {
      readonly op: "drag";
      readonly server: number;
      readonly body: number;
      /** Dragged point in the body's frame [m]. */
      readonly local: readonly [number, number, number];
      /** Where it is pulled to, in the world frame [m]. */
      readonly target?: readonly [number, number, number];
      /** Orientation to which the body is turned, w first. */
      readonly rotate?: readonly [number, number, number, number];
    };

/** What the relay sends as text. */
export type Message =
  | {
      readonly op: "hello";
      readonly protocol: number;
      readonly version: string;
      readonly viewer: string;
      readonly read_only: boolean;
      readonly servers: readonly Server[];
    }
  | { readonly op: "servers"; readonly servers: readonly Server[] }
  | { readonly op: "info"; readonly server: number; readonly info: Info }
  | { readonly op: "reply"; readonly id: number; readonly ok: true; readonly response: Fields }
  | { readonly op: "reply"; readonly id: number; readonly ok: false; readonly error: string }
  | { readonly op: "error"; readonly error: string };

/** Kinds of binary items. */
export const FRAME = 1;
export const OVERLAY = 2;
export const SAMPLES = 3;
export const IMAGE = 4;

/** Kinds of overlays, in the order of their channels. */
export const OVERLAY_KINDS = [
  "contacts",
  "contact_forces",
  "tendons",
  "joints",
  "actuators",
  "com",
  "inertia",
  "rangefinders",
  "frames",
  "perturbation",
] as const;
export type OverlayKind = (typeof OVERLAY_KINDS)[number];

/** Length of the header of a binary item [bytes]: kind, server, channel (uint16), batch (uint32), zero (8 bytes). */
export const ITEM_HEADER = 16;

/** A binary item; `payload` starts at a multiple of 8 bytes of its buffer. */
export interface Item {
  readonly kind: number;
  readonly server: number;
  readonly channel: number;
  readonly batch: number;
  readonly payload: DataView<ArrayBuffer>;
}

/** Returns the item in a binary message. */
export function readItem(buffer: ArrayBuffer): Item {
  const header = new DataView(buffer);
  return {
    kind: header.getUint8(0),
    server: header.getUint8(1),
    channel: header.getUint16(2, true),
    batch: header.getUint32(4, true),
    payload: new DataView(buffer, ITEM_HEADER),
  };
}
