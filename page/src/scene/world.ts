import { Group } from "three";
import type { Info } from "../wire/protocol.ts";
import type { Frame } from "./frame.ts";
import type { Pack } from "./pack.ts";

/** The objects of one server's model. */
export class World {
  /** All objects, in the world frame of the server. */
  readonly root = new Group();
  /** One group for each body, by body id, each a child of `root` with the body's pose in the world frame. */
  readonly bodies: readonly Group[];
  /** The newest frame, if any. */
  frame: Frame | null = null;

  constructor(
    readonly server: number,
    readonly name: string,
    public info: Info,
    readonly pack: Pack,
  ) {
    this.bodies = pack.header.bodies.map(({ name: bodyName, pos, quat }, index) => {
      const body = new Group();
      body.name = bodyName || `body ${index}`;
      body.position.fromArray(pos as number[]);
      body.quaternion.set(quat[1]!, quat[2]!, quat[3]!, quat[0]!);
      this.root.add(body);
      return body;
    });
  }

  /** Moves the bodies to the poses of a frame. */
  apply(frame: Frame): void {
    this.frame = frame;
    this.pack.header.moving.forEach((id, index) => {
      const [x, y, z, qw, qx, qy, qz] = frame.bodies.subarray(7 * index) as unknown as number[];
      const body = this.bodies[id]!;
      body.position.set(x!, y!, z!);
      body.quaternion.set(qx!, qy!, qz!, qw!);
    });
  }

  /** Frees the memory of the graphics card. */
  dispose(): void {
    this.root.removeFromParent();
  }
}
