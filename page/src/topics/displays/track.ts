import { MeshPhongMaterial, type Object3D } from "three";
import { select, slider, type Control } from "../../interface/controls.ts";
import type { Fields } from "../../wire/protocol.ts";
import { type Odometry, type Path, type PoseFields, type PoseStamped, stampOf } from "../messages.ts";
import { inverse, pose, type Pose } from "../transforms.ts";
import { plainArrow } from "./arrow.ts";
import { Axes } from "./axes.ts";
import type { Display, DisplayContext } from "./display.ts";
import { Lines, strip } from "./lines.ts";

const MOST = 5000;

function toPose({ position, orientation }: PoseFields): Pose {
  return pose(position, orientation);
}

/** A pose as an arrow along its x axis, or as axes. */
class PoseMark {
  readonly #axes = new Axes();
  readonly #arrow: Object3D;
  readonly #material: MeshPhongMaterial;

  constructor(readonly context: DisplayContext) {
    this.#material = new MeshPhongMaterial({ color: context.colour, shininess: 10 });
    this.#arrow = plainArrow(1, this.#material);
  }

  /** Adds the mark to an object, at a pose in the object's frame. */
  show(parent: Object3D, { position, rotation }: Pose): void {
    const size = this.context.option("size", 0.4);
    const axes = this.context.option<string>("shape", "arrow") === "axes";
    this.#arrow.visible = !axes;
    this.#axes.object.visible = axes;
    this.#arrow.position.copy(position);
    this.#arrow.quaternion.copy(rotation);
    this.#arrow.scale.setScalar(size);
    if (axes) this.#axes.set([{ position, rotation }], size);
    parent.add(this.#arrow, this.#axes.object);
  }

  controls(): Control[] {
    const { context } = this;
    return [
      select({
        label: "Shape",
        options: [
          { value: "arrow", text: "arrow" },
          { value: "axes", text: "axes" },
        ],
        value: context.option<string>("shape", "arrow"),
        change: (value) => context.setOption("shape", value),
      }),
      slider({
        label: "Size",
        unit: "m",
        min: 0.05,
        max: 2,
        step: 0.05,
        decimals: 2,
        value: context.option("size", 0.4),
        change: (value) => context.setOption("size", value),
      }),
    ];
  }

  dispose(): void {
    this.#arrow.removeFromParent();
    this.#axes.dispose();
    this.#material.dispose();
  }
}

/** The newest pose of a topic. */
export class PoseDisplay implements Display {
  protected readonly mark: PoseMark;
  readonly #line: Lines;

  constructor(readonly context: DisplayContext) {
    this.mark = new PoseMark(context);
    this.#line = new Lines({ colour: context.colour, width: 3 });
    context.group.add(this.#line.object);
  }

  show(message: Fields): void {
    const { header, pose: fields } = message as unknown as PoseStamped;
    this.place(header.frame_id, stampOf(header), toPose(fields), []);
  }

  protected place(frame: string, time: number | null, at: Pose | null, points: ArrayLike<number>): void {
    this.#line.set(strip(points));
    if (at !== null) this.mark.show(this.#line.object, at);
    this.context.placement.set(this.#line.object, frame, time);
  }

  controls(): Control[] {
    return this.mark.controls();
  }

  dispose(): void {
    this.context.placement.delete(this.#line.object);
    this.mark.dispose();
    this.#line.dispose();
  }
}

export class PathDisplay extends PoseDisplay {
  #count = 0;

  override show(message: Fields): void {
    const { header, poses } = message as unknown as Path;
    const points = poses.flatMap(({ pose: { position } }) => [position.x, position.y, position.z]);
    const last = poses.at(-1);
    this.#count = poses.length;
    this.place(header.frame_id, stampOf(header), last === undefined ? null : toPose(last.pose), points);
  }

  summary(): string {
    return `${this.#count} poses`;
  }
}

/** The path that a base has taken since its odometry is shown, and its pose. */
export class OdometryDisplay extends PoseDisplay {
  readonly all = true;
  #points: number[] = [];
  #time = -Infinity;

  override show(message: Fields): void {
    const odometry = message as unknown as Odometry;
    const { header, child_frame_id } = odometry;
    const at = toPose(odometry.pose.pose);
    const time = stampOf(header);
    const { x, y, z } = at.position;
    const [lastX = Infinity, lastY = Infinity, lastZ = Infinity] = this.#points.slice(-3);
    const step = Math.hypot(x - lastX, y - lastY, z - lastZ);
    // A base that jumps has been reset or placed.
    if (time !== null && (time < this.#time || (Number.isFinite(step) && step > 1 + 20 * (time - this.#time)))) {
      this.#points = [];
    }
    if (step > 0.01) this.#points.push(x, y, z);
    if (this.#points.length > 3 * MOST) this.#points.splice(0, 300);
    this.#time = time ?? this.#time;
    const { transforms } = this.context;
    if (!transforms.frames.has(header.frame_id)) {
      // Nobody publishes this transform, but the message contains it.
      this.context.placement.imply(header.frame_id, child_frame_id, inverse(at));
    }
    this.place(header.frame_id, time, at, [...this.#points, x, y, z]);
  }

  summary(): string {
    return `${this.#points.length / 3} points`;
  }
}
