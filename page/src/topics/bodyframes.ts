import { Matrix4, Quaternion, Vector3 } from "three";
import type { Frame } from "../scene/frame.ts";
import type { World } from "../scene/world.ts";
import { compose, interpolate, type Located, type Pose } from "./transforms.ts";

/** Poses of bodies are kept for this number of frames, so that messages get the pose at their time. */
const HISTORY = 180;
/** From a camera of MuJoCo, which looks along -z, to an optical frame, which looks along z. */
const OPTICAL = new Quaternion(1, 0, 0, 0);

type Read = (frame: Frame) => Pose;

/** Frames that are known without transforms: bodies, sites and cameras of a model, from the poses that are drawn. */
export class BodyFrames {
  readonly #readers = new Map<string, Read>();
  readonly #frames: Frame[] = [];

  constructor(readonly world: World) {
    const { bodies, moving } = world.pack.header;
    const slots = new Map(moving.map((body, slot) => [body, slot]));
    const readers = bodies.map(({ pos, quat }, body): Read => {
      const slot = slots.get(body);
      const fixed = toPose(pos, quat);
      return slot === undefined ? () => fixed : (frame) => toPose(frame.bodies, frame.bodies, 7 * slot, 7 * slot + 3);
    });
    const { cameras } = world.info;
    cameras.forEach((name, camera) => name !== "" && this.#readers.set(`${name}_frame`, readCamera(camera)));
    for (const { name, body, pos, quat } of world.pack.header.sites) {
      const offset = toPose(pos, quat);
      this.#readers.set(name, (frame) => compose(readers[body]!(frame), offset));
    }
    // If a body and a site have the same name, the body counts, as for the plugin `transforms`.
    bodies.forEach(({ name }, body) => this.#readers.set(name, readers[body]!));
    this.#readers.delete("");
  }

  /** The name of the world frame. */
  get worldName(): string {
    return this.world.pack.header.bodies[0]?.name || "world";
  }

  /** Remembers the newest frame. Call it before each drawing. */
  update(): void {
    const { frame } = this.world;
    const last = this.#frames.at(-1);
    if (frame === null || frame === last) return;
    // After a reset, the old poses say nothing about the new ones; after a new start, time begins again.
    if (last !== undefined && (last.epoch !== frame.epoch || last.time > frame.time)) this.#frames.length = 0;
    this.#frames.push(frame);
    if (this.#frames.length > HISTORY) this.#frames.shift();
  }

  /** Returns the pose of a body, site or camera in the world at a time [s]; null is the newest. */
  find(name: string, time: number | null): Located | null {
    const read = this.#readers.get(name);
    const last = this.#frames.at(-1);
    if (read === undefined || last === undefined) return null;
    if (time === null || time >= last.time) return { pose: read(last), complete: time !== null && time === last.time };
    const after = Math.max(
      1,
      this.#frames.findIndex((frame) => frame.time >= time),
    );
    const pair = this.#frames.slice(after - 1, after + 1);
    const times = pair.map((frame) => frame.time);
    return { pose: interpolate(times, pair.map(read), time), complete: true };
  }
}

function toPose(pos: ArrayLike<number>, quat: ArrayLike<number>, at = 0, turn = 0): Pose {
  return {
    position: new Vector3(pos[at], pos[at + 1], pos[at + 2]),
    rotation: new Quaternion(quat[turn + 1], quat[turn + 2], quat[turn + 3], quat[turn]),
  };
}

function readCamera(camera: number): Read {
  return ({ cameras }) => {
    const values = Array.from(cameras.subarray(12 * camera, 12 * camera + 12)) as number[];
    const [x, y, z, a, b, c, d, e, f, g, h, i] = values as unknown as [number, ...number[]] & number[];
    const matrix = new Matrix4().set(a!, b!, c!, 0, d!, e!, f!, 0, g!, h!, i!, 0, 0, 0, 0, 1);
    const rotation = new Quaternion().setFromRotationMatrix(matrix).multiply(OPTICAL);
    return { position: new Vector3(x, y!, z!), rotation };
  };
}
