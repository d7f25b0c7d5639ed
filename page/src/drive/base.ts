import type { App } from "../app.ts";
import type { Fields, TopicEntry } from "../wire/protocol.ts";
import type { Direction } from "./keymap.ts";
import type { Target } from "./teleop.ts";

export const TWIST = "geometry_msgs/msg/Twist";
export const TWIST_STAMPED = "geometry_msgs/msg/TwistStamped";

/** After this time without a message of the page, the relay publishes zero [s of wall time]. */
const TIMEOUT = 0.5;

/** Largest velocities that the page asks for. */
export interface Limits {
  /** [m/s] */
  linear: number;
  /** [rad/s] */
  yaw: number;
}

/** A base that follows a topic of velocities. */
export class Base implements Target {
  constructor(
    readonly app: App,
    readonly topic: TopicEntry,
    readonly limits: Limits,
  ) {}

  send({ x, y, yaw }: Direction): void {
    const { linear, yaw: turn } = this.limits;
    this.#publish(this.#message(x * linear, y * linear, yaw * turn), true);
  }

  stop(): void {
    this.#publish(this.#message(0, 0, 0), false);
  }

  #publish(message: Fields, guarded: boolean): void {
    const { name, type, server } = this.topic;
    if (guarded) this.app.source.publish(server, name, type, message, this.#message(0, 0, 0), TIMEOUT);
    else this.app.source.publish(server, name, type, message);
  }

  #message(x: number, y: number, yaw: number): Fields {
    const twist = { linear: { x, y, z: 0 }, angular: { x: 0, y: 0, z: yaw } };
    if (this.topic.type === TWIST) return twist;
    const time = this.app.stage.worlds.get(this.topic.server)?.frame?.time ?? 0;
    const sec = Math.floor(time);
    const stamp = { sec, nanosec: Math.min(999_999_999, Math.round(1e9 * (time - sec))) };
    return { header: { stamp, frame_id: "" }, twist };
  }
}
