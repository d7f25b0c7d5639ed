import { Color, Group } from "three";
import type { App } from "../app.ts";
import type { World } from "../scene/world.ts";
import type { TopicEntry } from "../wire/protocol.ts";
import type { Sample } from "../wire/source.ts";
import { type Display, type DisplayContext, paletteColour } from "./displays/display.ts";
import { MarkersDisplay } from "./displays/markers.ts";
import { CloudDisplay, ScanDisplay } from "./displays/scan.ts";
import { OdometryDisplay, PathDisplay, PoseDisplay } from "./displays/track.ts";
import { TreeDisplay } from "./displays/tree.ts";
import type { FrameFinder } from "./frames.ts";
import { type Live, samples } from "./live.ts";
import { Placement } from "./placement.ts";
import { Rate } from "./rate.ts";

type Create = new (context: DisplayContext) => Display;

/** What draws the messages of each type. */
const DISPLAYS = new Map<string, Create>([
  ["sensor_msgs/msg/LaserScan", ScanDisplay],
  ["sensor_msgs/msg/PointCloud2", CloudDisplay],
  ["visualization_msgs/msg/MarkerArray", MarkersDisplay],
  ["visualization_msgs/msg/Marker", MarkersDisplay],
  ["tf2_msgs/msg/TFMessage", TreeDisplay],
  ["nav_msgs/msg/Odometry", OdometryDisplay],
  ["nav_msgs/msg/Path", PathDisplay],
  ["geometry_msgs/msg/PoseStamped", PoseDisplay],
]);

export function isDisplayed(type: string): boolean {
  return DISPLAYS.has(type);
}

/** A topic that is shown in the scene. It is subscribed to as long as this object is not closed. */
export class Layer {
  readonly rate = new Rate();
  readonly display: Display;
  readonly #group = new Group();
  readonly #placement: Placement;
  readonly #release: () => void;
  readonly #live: Live;
  #error = "";

  constructor(
    readonly app: App,
    readonly topic: TopicEntry,
    finder: FrameFinder,
    index: number,
  ) {
    const { transforms, release } = finder.use(topic.name);
    this.#release = release;
    this.#placement = new Placement(finder, transforms, () => this.#world());
    this.#group.name = `topic ${topic.name}`;
    const { settings } = app;
    const name = (option: string) => `topic.${topic.name}.${option}`;
    const Create = DISPLAYS.get(topic.type)!;
    this.display = new Create({
      group: this.#group,
      placement: this.#placement,
      transforms,
      colour: new Color(paletteColour(index)),
      now: () => this.#world()?.frame?.time ?? null,
      option: (option, fallback) => settings.get(name(option), fallback),
      setOption: (option, value) => {
        settings.set(name(option), value);
        app.stage.invalidate();
      },
    });
    const mode = this.display.all === true ? "all" : "newest";
    const fail = (sentence: string) => (this.#error = sentence);
    this.#live = samples(app.source, topic.name, mode, (received) => this.#receive(received), fail);
  }

  /** Why the topic is not shown completely; empty if it is. */
  get problem(): string {
    return this.#error || this.#placement.problem;
  }

  /** Called before each drawing. */
  update(): void {
    const root = this.#world()?.root;
    if (root !== undefined && this.#group.parent !== root) root.add(this.#group);
    const placed = this.#placement.update();
    const changed = this.display.update?.() ?? false;
    if (placed || changed) this.app.stage.invalidate();
  }

  close(): void {
    this.#live.close();
    this.display.dispose();
    this.#group.removeFromParent();
    this.#release();
    this.app.stage.invalidate();
  }

  #world(): World | undefined {
    const { worlds } = this.app.stage;
    return worlds.get(this.topic.server) ?? worlds.values().next().value;
  }

  #receive(received: readonly Sample[]): void {
    this.#error = "";
    for (const { message } of received) {
      this.rate.count();
      try {
        this.display.show(message);
      } catch (error) {
        this.#error = (error as Error).message;
      }
    }
    this.app.stage.invalidate();
  }
}
