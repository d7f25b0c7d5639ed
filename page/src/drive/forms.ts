import type { App } from "../app.ts";
import { button, field, select, type Button, type Select } from "../interface/controls.ts";
import { element, setText } from "../interface/element.ts";
import { fixed, rollPitchYaw } from "../interface/format.ts";
import type { World } from "../scene/world.ts";
import type { InterfaceList } from "../topics/interfaces.ts";

const WRENCH = "mujoco_ros2_control_msgs/srv/ApplyExternalWrench";
const PLACE = "mujoco_ros2_control_msgs/srv/SetFreeJointState";
const READ_ONLY = "This page is read-only.";

/** Number fields in a row, such as x, y and z. */
class Numbers {
  readonly element = element("div", { className: "numbers" });
  readonly #inputs: HTMLInputElement[] = [];

  constructor(title: string, names: readonly string[], unit: string, decimals = 3) {
    this.element.append(element("span", { className: "numbers-title" }, `${title} [${unit}]`));
    for (const name of names) {
      const created = field({ label: name, type: "number", value: "0", change: () => undefined });
      created.input.step = "any";
      created.input.setAttribute("aria-label", `${title} ${name} [${unit}]`);
      this.#inputs.push(created.input);
      this.element.append(created.element);
    }
    this.#decimals = decimals;
  }
  readonly #decimals: number;

  get values(): number[] {
    return this.#inputs.map((input) => Number(input.value));
  }

  set values(values: readonly number[]) {
    values.forEach((value, index) => (this.#inputs[index]!.value = `${Number(value.toFixed(this.#decimals))}`));
  }
}

function xyz([x = 0, y = 0, z = 0]: readonly number[]): { x: number; y: number; z: number } {
  return { x, y, z };
}

function duration(time: number): { sec: number; nanosec: number } {
  const nanoseconds = Math.max(0, Math.round(1e9 * time));
  return { sec: Math.floor(nanoseconds / 1e9), nanosec: nanoseconds % 1e9 };
}

/** Returns the quaternion for rotations about the fixed axes x, y and z [rad]. */
export function fromRollPitchYaw([roll = 0, pitch = 0, yaw = 0]: readonly number[]): {
  x: number;
  y: number;
  z: number;
  w: number;
} {
  const [cr, sr] = [Math.cos(roll / 2), Math.sin(roll / 2)];
  const [cp, sp] = [Math.cos(pitch / 2), Math.sin(pitch / 2)];
  const [cy, sy] = [Math.cos(yaw / 2), Math.sin(yaw / 2)];
  return {
    x: sr * cp * cy - cr * sp * sy,
    y: cr * sp * cy + sr * cp * sy,
    z: cr * cp * sy - sr * sp * cy,
    w: cr * cp * cy + sr * sp * sy,
  };
}

/** What both forms have in common: a body, a button, and a line with the result. */
abstract class BodyForm {
  protected readonly body: Select;
  protected readonly result = element("p", { className: "hint" });
  protected abstract readonly go: Button;

  constructor(
    readonly app: App,
    readonly interfaces: InterfaceList,
    change: () => void,
  ) {
    this.body = select({ label: "Body", options: [], change });
    app.selection.listen((selected) => {
      const name = selected?.world.info.bodies[selected.body] ?? "";
      if (![...this.body.select.options].some(({ value }) => value === name)) return;
      this.body.value = name;
      change();
    });
    app.source.listen({ onInfo: () => this.refresh() });
    app.stage.onWorld(() => this.refresh());
    interfaces.listen(() => this.refresh());
  }

  protected abstract readonly service: string;
  protected abstract readonly missing: string;
  protected abstract bodies(world: World): string[];

  protected world(): World | undefined {
    return [...this.app.stage.worlds.values()].find((world) => this.bodies(world).includes(this.body.value));
  }

  protected name(): string | undefined {
    const server = this.world()?.server;
    const fitting = this.interfaces.services.filter(({ type }) => type === this.service);
    return (fitting.find((entry) => entry.server === server) ?? fitting[0])?.name;
  }

  protected refresh(): void {
    const names = [...this.app.stage.worlds.values()].flatMap((world) => this.bodies(world));
    this.body.set(names.map((name) => ({ value: name, text: name })));
    const reason = this.app.source.readOnly
      ? READ_ONLY
      : names.length === 0
        ? "The model has no such body."
        : this.name() === undefined
          ? this.missing
          : null;
    this.go.disable(reason);
    if (reason !== null) setText(this.result, reason);
    else if (this.result.textContent === this.missing) setText(this.result, "");
  }

  /** Calls the service and shows its answer. */
  protected async send(request: { readonly [name: string]: unknown }, waiting: string): Promise<void> {
    setText(this.result, waiting);
    try {
      const response = await this.app.source.call(this.world()?.server ?? 0, this.name()!, request);
      setText(this.result, String(response["message"]));
    } catch (error) {
      setText(this.result, (error as Error).message);
      this.app.shell.notice((error as Error).message, "error");
    }
  }
}

/** Pushes a body with a force and a torque for some time. */
export class PushForm extends BodyForm {
  protected readonly service = WRENCH;
  protected readonly missing = "No server offers pushes. Add the plugin external_wrench.";
  protected readonly go: Button;

  constructor(app: App, interfaces: InterfaceList) {
    super(app, interfaces, () => undefined);
    const content = app.shell.panel("Push", {
      icon: "push",
      order: 72,
      onToggle: (open) => interfaces.use(this, open),
    });
    const force = new Numbers("Force", ["x", "y", "z"], "N");
    const torque = new Numbers("Torque", ["x", "y", "z"], "N·m");
    const point = new Numbers("At", ["x", "y", "z"], "m");
    force.values = [10, 0, 0];
    const time = field({ label: "Duration", type: "number", value: "0.5", unit: "s", change: () => undefined });
    time.input.min = "0";
    time.input.step = "any";
    const push = () => {
      const wrench = {
        wrench: {
          header: { frame_id: this.body.value },
          wrench: { force: xyz(force.values), torque: xyz(torque.values) },
        },
        application_point: xyz(point.values),
        duration: duration(Number(time.input.value)),
      };
      const paused = this.world()?.info.paused === true;
      const waiting = paused ? "The push begins when the simulation continues." : "Pushing …";
      void this.send({ wrenches: { external_wrenches: [wrench] } }, waiting);
    };
    this.go = button({ icon: "push", text: "Push", run: push });
    const frame = element(
      "p",
      { className: "hint" },
      "Force, torque and point are in the frame of the body and turn with it.",
    );
    content.append(this.body.element, force.element, torque.element, point.element, time.element);
    content.append(element("div", { className: "row" }, this.go.element), this.result, frame);
    this.refresh();
  }

  protected bodies({ info, pack }: World): string[] {
    const moving = new Set(pack.header.moving);
    return info.bodies.filter((name, body) => name !== "" && moving.has(body));
  }
}

/** Places a body with a free joint. */
export class PlaceForm extends BodyForm {
  protected readonly service = PLACE;
  protected readonly missing = "No server offers to place bodies.";
  protected readonly go: Button;
  readonly #position = new Numbers("Position", ["x", "y", "z"], "m");
  readonly #angles = new Numbers("Orientation", ["roll", "pitch", "yaw"], "°", 2);

  constructor(app: App, interfaces: InterfaceList) {
    super(app, interfaces, () => this.#read());
    const content = app.shell.panel("Place", {
      icon: "home",
      order: 73,
      onToggle: (open) => {
        interfaces.use(this, open);
        if (open) this.#read();
      },
    });
    const place = () => {
      const orientation = fromRollPitchYaw(this.#angles.values.map((angle) => (angle * Math.PI) / 180));
      const pose = { pose: { position: xyz(this.#position.values), orientation } };
      void this.send({ free_joints: [{ name: this.body.value, pose }] }, "Placing …");
    };
    const read = button({ text: "From the present pose", run: () => this.#read() });
    this.go = button({ icon: "home", text: "Place", run: place });
    const note = element("p", { className: "hint" }, "In the world frame; the body stands still afterwards.");
    content.append(this.body.element, this.#position.element, this.#angles.element);
    content.append(element("div", { className: "row" }, this.go.element, read.element), this.result, note);
    this.refresh();
  }

  protected bodies({ info }: World): string[] {
    return info.joints
      .filter(({ type }) => type === "free")
      .map(({ body }) => info.bodies[body] ?? "")
      .filter(Boolean);
  }

  protected override refresh(): void {
    const before = this.body.value;
    super.refresh();
    if (before !== this.body.value) this.#read();
  }

  #read(): void {
    const world = this.world();
    const body = world?.bodies[world.info.bodies.indexOf(this.body.value)];
    if (body === undefined) return;
    const { x, y, z, w } = body.quaternion;
    this.#position.values = body.position.toArray();
    this.#angles.values = rollPitchYaw([w, x, y, z]).map((angle) => (angle * 180) / Math.PI);
    setText(this.result, `Present height ${fixed(body.position.z, 3)} m`);
  }
}
