import type { App } from "../app.ts";
import { select, slider, toggle, type Slider } from "../interface/controls.ts";
import { element, setText } from "../interface/element.ts";
import { fixed } from "../interface/format.ts";
import type { InterfaceList } from "../topics/interfaces.ts";
import { type Live, samples } from "../topics/live.ts";
import type { JointState } from "../topics/messages.ts";
import type { Info, JointInfo, TopicEntry } from "../wire/protocol.ts";
import { commandable, Jog, JointCommands, jointRange } from "./jog.ts";
import { jogButton } from "./jogbutton.ts";

const JOINT_STATE = "sensor_msgs/msg/JointState";
/** Repetition of the positions while they are held [ms]. */
const HOLD = 100;
const DEGREE = Math.PI / 180;
const NOTHING = "No plugin of a server follows joint commands. Add the plugin joint_commands to move joints.";
const UNMEASURED =
  "Positions are not measured: no server publishes joint states. Add the plugin joint_state_publisher.";

interface Row {
  readonly joint: JointInfo;
  readonly slider: Slider;
  readonly measured: HTMLElement;
  /** Units of the slider per rad or m. */
  readonly scale: number;
  readonly unit: string;
}

/** Sliders that command the positions of joints. */
export class JointPanel {
  readonly #content: HTMLElement;
  readonly #target = select({ label: "Commands to", options: [], change: () => this.#rebuild() });
  readonly #rows = element("div");
  readonly #hint = element("p", { className: "hint" });
  readonly #commands = new Map<string, JointCommands>();
  #sliders: Row[] = [];
  #live: Live | null = null;
  #states = "";
  #open = false;
  #driven = false;
  #hold = false;
  #shape = "";
  /** Positions to hold; those that the user has set since "hold" is on. */
  readonly #held = new Map<string, number>();

  constructor(
    readonly app: App,
    readonly interfaces: InterfaceList,
  ) {
    const { settings, shell } = app;
    this.#content = shell.panel("Joints", { icon: "joint", order: 71, onToggle: (open) => this.#toggle(open) });
    const degrees = toggle({
      text: "Degrees",
      value: settings.get("joints.degrees", false),
      change: (value) => {
        settings.set("joints.degrees", value);
        this.#rebuild();
      },
    });
    const hold = toggle({
      text: "Hold",
      hint: "Repeats the positions that you set, against other controllers",
      change: (value) => {
        this.#hold = value;
        this.#held.clear();
      },
    });
    const speed = slider({
      label: "Jog speed",
      unit: "rad/s",
      min: 0.05,
      max: 3,
      step: 0.05,
      decimals: 2,
      value: this.jogSpeed,
      change: (value) => settings.set("joints.speed", value),
    });
    const switches = element("div", { className: "columns" }, degrees.element, hold.element);
    this.#content.append(this.#target.element, switches, speed.element, this.#hint, this.#rows);
    interfaces.listen(() => this.#refresh());
    app.source.listen({ onInfo: () => this.#refresh(), onState: () => this.#held.clear() });
    setInterval(() => this.#update(), HOLD);
    this.#refresh();
  }

  /** Topics that follow positions of joints. */
  get targets(): TopicEntry[] {
    return this.interfaces.commands(JOINT_STATE);
  }

  /** [rad/s, m/s] */
  get jogSpeed(): number {
    return this.app.settings.get("joints.speed", 0.5);
  }

  /** Joints that can be commanded. */
  get movable(): JointInfo[] {
    const info = this.#info();
    return info === undefined ? [] : commandable(info).actuated;
  }

  commandsOf(topic: TopicEntry): JointCommands {
    let commands = this.#commands.get(topic.name);
    if (commands === undefined) {
      commands = new JointCommands(this.app, topic);
      this.#commands.set(topic.name, commands);
    }
    return commands;
  }

  /** Says whether a joint is driven; that starts at its measured position. */
  set driven(on: boolean) {
    this.#driven = on;
    this.#measure();
  }

  #topic(): TopicEntry | undefined {
    return this.targets.find(({ name }) => name === this.#target.value) ?? this.targets[0];
  }

  #info(): Info | undefined {
    const { infos } = this.app.source;
    return infos.get(this.#topic()?.server ?? -1) ?? (infos.values().next().value as Info | undefined);
  }

  #toggle(open: boolean): void {
    this.#open = open;
    this.interfaces.use(this, open);
    this.#measure();
    if (open) this.#rebuild();
    else this.#held.clear();
  }

  #refresh(): void {
    const before = this.#target.value;
    this.#target.set(this.targets.map(({ name }) => ({ value: name, text: name })));
    this.#target.element.hidden = this.targets.length < 2;
    const info = this.#info();
    const shape = JSON.stringify([info?.joints, this.targets.length === 0, this.app.source.readOnly]);
    if (shape === this.#shape && before === this.#target.value) return;
    this.#shape = shape;
    this.#rebuild();
  }

  /** Subscribes to measured positions while the panel is open or a joint is driven. */
  #measure(): void {
    const server = this.#topic()?.server;
    const states = this.interfaces.topics.find(
      (topic) =>
        topic.type === JOINT_STATE && topic.publishers > 0 && (server === undefined || topic.server === server),
    );
    const name = this.#open || this.#driven ? (states?.name ?? "") : "";
    if (name === this.#states) return;
    this.#live?.close();
    this.#states = name;
    const warn = (sentence: string) => setText(this.#hint, sentence);
    this.#live =
      name === ""
        ? null
        : samples(
            this.app.source,
            name,
            "newest",
            (received) => this.#receive(received.at(-1)!.message as never),
            warn,
          );
  }

  #receive(state: JointState): void {
    const topic = this.#topic();
    if (topic === undefined) return;
    const { measured } = this.commandsOf(topic);
    state.name.forEach((name, index) => {
      const position = state.position[index];
      if (position !== undefined) measured.set(name, position);
    });
  }

  #rebuild(): void {
    this.#sliders = [];
    this.#rows.replaceChildren();
    const topic = this.#topic();
    const info = this.#info();
    const reason = this.app.source.readOnly ? "This page is read-only." : topic === undefined ? NOTHING : "";
    setText(this.#hint, reason);
    if (!this.#open || info === undefined || topic === undefined) return;
    const { actuated, others } = commandable(info);
    this.#rows.append(...actuated.map((joint) => this.#row(topic, joint)));
    if (others.length === 0) return;
    const rest = element("details", {}, element("summary", {}, "Joints without an actuator of their own"));
    rest.append(...others.map((joint) => this.#row(topic, joint)));
    this.#rows.append(rest);
  }

  #row(topic: TopicEntry, joint: JointInfo): HTMLElement {
    const degrees = joint.type === "hinge" && this.app.settings.get("joints.degrees", false);
    const scale = degrees ? 1 / DEGREE : 1;
    const unit = joint.type === "slide" ? "m" : degrees ? "°" : "rad";
    const commands = this.commandsOf(topic);
    const [low, high] = jointRange(joint);
    const start = commands.measured.get(joint.name) ?? commands.commanded.get(joint.name) ?? 0;
    const control = slider({
      label: joint.name,
      unit,
      min: scale * low,
      max: scale * high,
      value: scale * start,
      decimals: degrees ? 1 : 3,
      change: (value) => {
        const position = value / scale;
        if (this.#hold) this.#held.set(joint.name, position);
        commands.send(new Map([[joint.name, position]]));
      },
    });
    const measured = element("span", { className: "measured", title: "Measured position" });
    const jog = new Jog(
      commands,
      () => joint,
      () => this.jogSpeed,
    );
    const minus = jogButton("−", `Jog ${joint.name} down`, -1, jog);
    const plus = jogButton("+", `Jog ${joint.name} up`, 1, jog);
    if (this.app.source.readOnly) control.disable("This page is read-only.");
    this.#sliders.push({ joint, slider: control, measured, scale, unit });
    return element(
      "div",
      { className: "joint" },
      control.element,
      element("div", { className: "row" }, minus, plus, measured),
    );
  }

  #update(): void {
    const topic = this.#topic();
    if (topic === undefined) return;
    if (this.#hold && this.#open) this.commandsOf(topic).send(this.#held);
    if (!this.#open) return;
    this.#measure();
    const { measured } = this.commandsOf(topic);
    if (!this.app.source.readOnly) setText(this.#hint, this.#states === "" ? UNMEASURED : "");
    for (const { joint, slider: control, measured: text, scale, unit } of this.#sliders) {
      const position = measured.get(joint.name);
      setText(text, position === undefined ? "" : `measured ${fixed(scale * position, unit === "°" ? 1 : 3)} ${unit}`);
      if (position !== undefined && !this.#held.has(joint.name)) control.value = scale * position;
    }
  }
}
