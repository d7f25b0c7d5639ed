import type { App } from "../app.ts";
import type { Info, JointInfo, TopicEntry } from "../wire/protocol.ts";
import type { Direction } from "./keymap.ts";
import { RATE, type Target } from "./teleop.ts";

/** Positions of the joints of one server, as measured and as commanded [rad, m]. */
export class JointCommands {
  readonly measured = new Map<string, number>();
  readonly commanded = new Map<string, number>();

  constructor(
    readonly app: App,
    readonly topic: TopicEntry,
  ) {}

  /** Sends positions of some joints. */
  send(positions: ReadonlyMap<string, number>): void {
    if (positions.size === 0) return;
    for (const [joint, position] of positions) this.commanded.set(joint, position);
    const { server, name, type } = this.topic;
    const message = { name: [...positions.keys()], position: [...positions.values()], velocity: [], effort: [] };
    this.app.source.publish(server, name, type, message);
  }
}

/** Range of a slider of a joint [rad, m]. */
export function jointRange({ type, range }: JointInfo): readonly [number, number] {
  return range ?? (type === "slide" ? [-1, 1] : [-Math.PI, Math.PI]);
}

/**
 * Moves a joint while a key or button is held. The target moves with the page's messages only, so the joint stops when the
 * page falls silent.
 */
export class Jog implements Target {
  #target: number | null = null;

  constructor(
    readonly commands: JointCommands,
    readonly joint: () => JointInfo,
    /** [rad/s, m/s] */
    readonly speed: () => number,
  ) {}

  send({ x }: Direction): void {
    const joint = this.joint();
    const { measured, commanded } = this.commands;
    const start = this.#target ?? measured.get(joint.name) ?? commanded.get(joint.name);
    // Without a start, the joint would jump.
    if (start === undefined || x === 0) return;
    const [low, high] = jointRange(joint);
    this.#target = Math.max(low, Math.min(high, start + (x * this.speed()) / RATE));
    this.commands.send(new Map([[joint.name, this.#target]]));
  }

  stop(): void {
    this.#target = null;
  }
}

/** Returns the hinges and slides of a model: those with an actuator, and the others. */
export function commandable({ joints, actuators }: Info): { actuated: JointInfo[]; others: JointInfo[] } {
  const moving = joints.filter(({ name, type }) => name !== "" && (type === "hinge" || type === "slide"));
  const driven = new Set<string>();
  for (const { name, joint } of actuators) {
    driven.add(name);
    if (typeof joint === "number") driven.add(joints[joint]?.name ?? "");
  }
  const actuated = moving.filter(({ name }) => driven.has(name));
  // Servers before this page do not report the joints of actuators.
  if (actuated.length === 0) return { actuated: moving, others: [] };
  return { actuated, others: moving.filter(({ name }) => !driven.has(name)) };
}
