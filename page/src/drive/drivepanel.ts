import type { App } from "../app.ts";
import { button, select, slider, toggle, type Button, type Slider } from "../interface/controls.ts";
import { element, setText } from "../interface/element.ts";
import { fixed } from "../interface/format.ts";
import type { InterfaceList } from "../topics/interfaces.ts";
import type { JointInfo, TopicEntry } from "../wire/protocol.ts";
import { Base, type Limits, TWIST, TWIST_STAMPED } from "./base.ts";
import { Jog } from "./jog.ts";
import type { JointPanel } from "./joints.ts";
import { joystick } from "./joystick.ts";
import { RATE, type Target, Teleop } from "./teleop.ts";

const KEYS = `Keys while it is on: i forward, , back, j and l turn, u o m . both, with Shift to the side; or W A S D and arrows.
q and z change the speeds, Space or k stops, Esc switches off. A gamepad works too.`;
const SWITCH_ON = "Switch on";
const SWITCH_ON_LABEL = "Switch on: let keys, gamepad and joystick drive";
const SWITCH_OFF = "Switch off";
const NOTHING =
  "No server follows a topic of velocities or joint commands. The plugins base_velocity and joint_commands do.";
const JOINT_MODE = "joints ";

/** The panel that drives a base or a joint with keys, a gamepad or a finger. */
export class DrivePanel {
  readonly limits: Limits;
  readonly #teleop: Teleop;
  readonly #target = select({ label: "Drive", options: [], change: () => this.#changed() });
  readonly #joint = select({ label: "Joint", options: [], change: () => this.#teleop.release() });
  readonly #arm: Button;
  readonly #status = element("p", { className: "hint drive-status" });
  readonly #overlay = element("div", { className: "drive-overlay", hidden: true });
  readonly #text = element("span");
  readonly #stick: HTMLElement;
  readonly #sliders: { readonly linear: Slider; readonly yaw: Slider };
  readonly #baseOptions: HTMLElement;

  constructor(
    readonly app: App,
    readonly interfaces: InterfaceList,
    readonly joints: JointPanel,
  ) {
    const { settings, shell } = app;
    this.limits = { linear: settings.get("drive.linear", 0.5), yaw: settings.get("drive.yaw", 1) };
    this.#teleop = new Teleop(
      () => this.#describe(),
      (linear, yaw) => this.#scale(linear, yaw),
    );
    const limit = (name: keyof Limits, label: string, unit: string, max: number) =>
      slider({
        label,
        unit,
        min: 0.01,
        max,
        step: 0.01,
        decimals: 2,
        value: this.limits[name],
        change: (value) => this.#setLimit(name, value),
      });
    this.#sliders = { linear: limit("linear", "Speed", "m/s", 3), yaw: limit("yaw", "Turn", "rad/s", 4) };
    this.#arm = button({ icon: "drive", text: SWITCH_ON, label: SWITCH_ON_LABEL, run: () => this.#flip() });
    this.#stick = joystick((direction) => this.#teleop.touch(direction));
    const coarse = matchMedia("(pointer: coarse)").matches;
    const shown = settings.get("drive.joystick", coarse);
    this.#stick.hidden = !shown;
    const stick = toggle({
      text: "Joystick on the screen",
      value: shown,
      change: (value) => {
        settings.set("drive.joystick", value);
        this.#stick.hidden = !value;
      },
    });
    const content = shell.panel("Drive", {
      icon: "drive",
      order: 70,
      onToggle: (open) => {
        interfaces.use(this, open);
        if (!open) this.#teleop.disarm();
      },
    });
    this.#baseOptions = element("div", {}, this.#sliders.linear.element, this.#sliders.yaw.element);
    const row = element("div", { className: "row" }, this.#arm.element);
    content.append(this.#target.element, this.#joint.element, this.#baseOptions, stick.element, row, this.#status);
    content.append(element("p", { className: "hint" }, KEYS));
    const stop = button({
      text: "Stop",
      label: "Stop and switch off",
      className: "primary",
      run: () => this.#teleop.disarm(),
    });
    this.#overlay.append(element("div", { className: "drive-banner" }, this.#text, stop.element), this.#stick);
    shell.stageElement.append(this.#overlay);
    interfaces.listen(() => this.#refresh());
    this.#listen();
    this.#refresh();
  }

  #listen(): void {
    const { source } = this.app;
    const typing = (event: KeyboardEvent) =>
      event.ctrlKey ||
      event.metaKey ||
      event.altKey ||
      document.querySelector("dialog[open]") !== null ||
      (event.target instanceof Element && event.target.closest("input, select, textarea, [contenteditable]") !== null);
    // In the capture phase, so that keys that drive do not also work as shortcuts.
    document.addEventListener(
      "keydown",
      (event) => {
        if (typing(event) || !this.#teleop.keyDown(event.key, event.shiftKey)) return;
        event.preventDefault();
        event.stopPropagation();
      },
      true,
    );
    document.addEventListener("keyup", (event) => this.#teleop.keyUp(event.key, event.shiftKey), true);
    // The page does not see releases of keys while another window has the focus.
    window.addEventListener("blur", () => this.#teleop.armed && this.#teleop.release());
    document.addEventListener("visibilitychange", () => document.hidden && this.#teleop.disarm());
    window.addEventListener("pagehide", () => this.#teleop.disarm());
    source.listen({
      onState: ({ connected }) => connected || this.#teleop.disarm(),
      onInfo: () => this.#refresh(),
      // For example, the access rules of the server forbid to drive.
      onError: (sentence) => {
        if (!this.#teleop.armed) return;
        this.#teleop.disarm();
        this.app.shell.notice(sentence, "error");
      },
      onServers: (servers) => {
        const server = this.#entry()?.server;
        if (servers.some(({ id, connected }) => id === server && !connected)) this.#teleop.disarm();
      },
    });
    setInterval(() => {
      if (!this.#teleop.armed) return;
      this.#pollGamepad();
      this.#teleop.tick();
    }, 1000 / RATE);
  }

  #pollGamepad(): void {
    // Browsers offer gamepads on secure origins only, and only to the window with the focus.
    const pads = typeof navigator.getGamepads === "function" && document.hasFocus() ? navigator.getGamepads() : [];
    const pad = [...pads].find((one) => one !== null);
    if (pad) this.#teleop.gamepad(pad.axes, pad.buttons[1]?.pressed ?? false);
    else this.#teleop.gamepad([], false);
  }

  #entry(): TopicEntry | undefined {
    const name = this.#target.value.replace(JOINT_MODE, "");
    return this.interfaces.topics.find((topic) => topic.name === name);
  }

  #refresh(): void {
    const bases = this.interfaces.commands(TWIST, TWIST_STAMPED).map(({ name }) => ({ value: name, text: name }));
    const joints = this.joints.targets.map(({ name }) => ({ value: JOINT_MODE + name, text: `a joint: ${name}` }));
    const before = this.#target.value;
    this.#target.set([...bases, ...joints]);
    if (this.#target.value !== before) this.#teleop.disarm();
    const reason = this.app.source.readOnly
      ? "This page is read-only."
      : bases.length + joints.length === 0
        ? NOTHING
        : null;
    for (const control of [this.#target, this.#arm]) control.disable(reason);
    this.#joint.set(this.joints.movable.map(({ name }) => ({ value: name, text: name })));
    this.#describe();
  }

  /** Another target was chosen. */
  #changed(): void {
    this.#teleop.disarm();
    this.#describe();
  }

  #flip(): void {
    if (this.#teleop.armed) {
      this.#teleop.disarm();
      return;
    }
    const target = this.#create();
    if (target === null) return;
    this.#teleop.arm(target);
    // Otherwise Space and Enter would press the button.
    this.#arm.element.blur();
  }

  #create(): Target | null {
    const entry = this.#entry();
    if (entry === undefined) return null;
    if (!this.#target.value.startsWith(JOINT_MODE)) return new Base(this.app, entry, this.limits);
    const commands = this.joints.commandsOf(entry);
    this.joints.driven = true;
    const joint = (): JointInfo => this.joints.movable.find(({ name }) => name === this.#joint.value)!;
    return new Jog(commands, joint, () => this.joints.jogSpeed);
  }

  #setLimit(name: keyof Limits, value: number): void {
    this.limits[name] = value;
    this.app.settings.set(`drive.${name}`, value);
    this.#describe();
  }

  #scale(linear: number, yaw: number): void {
    this.#setLimit("linear", Math.min(3, this.limits.linear * linear));
    this.#setLimit("yaw", Math.min(4, this.limits.yaw * yaw));
    this.#sliders.linear.value = this.limits.linear;
    this.#sliders.yaw.value = this.limits.yaw;
  }

  #describe(): void {
    const { armed, direction } = this.#teleop;
    if (!armed) this.joints.driven = false;
    const joint = this.#target.value.startsWith(JOINT_MODE);
    this.#joint.element.hidden = !joint;
    this.#baseOptions.hidden = joint;
    this.#arm.set(armed ? { text: SWITCH_OFF, label: SWITCH_OFF } : { text: SWITCH_ON, label: SWITCH_ON_LABEL });
    this.#overlay.hidden = !armed;
    const { linear, yaw } = this.limits;
    const [x, y, turn] = [direction.x * linear, direction.y * linear, direction.yaw * yaw];
    const moving = joint
      ? `${this.#joint.value} ${direction.x > 0 ? "+" : direction.x < 0 ? "−" : "stopped"}`
      : `x ${fixed(x, 2)} m/s · y ${fixed(y, 2)} m/s · turn ${fixed(turn, 2)} rad/s`;
    setText(this.#status, armed ? moving : "Off: keys do not drive.");
    setText(this.#text, `Driving ${this.#target.value.replace(JOINT_MODE, "")}: ${moving}`);
  }
}
