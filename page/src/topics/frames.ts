import type { App } from "../app.ts";
import type { World } from "../scene/world.ts";
import type { TopicEntry } from "../wire/protocol.ts";
import type { Sample } from "../wire/source.ts";
import { BodyFrames } from "./bodyframes.ts";
import type { InterfaceList } from "./interfaces.ts";
import { type Live, samples } from "./live.ts";
import { seconds, type TransformStamped } from "./messages.ts";
import { type Located, pose, Transforms } from "./transforms.ts";

const TF = "tf2_msgs/msg/TFMessage";

/** The transforms of one namespace: `/robot1/tf` and `/robot1/tf_static` belong to `/robot1`. */
interface Tree {
  readonly transforms: Transforms;
  readonly subscriptions: Live[];
  users: number;
}

/** Finds poses of frames by transforms, or by the bodies of a model. Transforms are subscribed to only while used. */
export class FrameFinder {
  readonly #trees = new Map<string, Tree>();
  readonly #bodies = new Map<World, BodyFrames>();

  constructor(
    readonly app: App,
    readonly interfaces: InterfaceList,
  ) {
    app.stage.onWorld((world) => {
      for (const [old] of this.#bodies) if (old.server === world.server) this.#bodies.delete(old);
      this.#bodies.set(world, new BodyFrames(world));
    });
    app.stage.onRemove((world) => this.#bodies.delete(world));
    app.stage.beforeDraw(() => {
      for (const bodies of this.#bodies.values()) bodies.update();
    });
    interfaces.listen(() => this.#resubscribe());
  }

  /** Subscribes to the transforms for a topic; call the result once to end that. */
  use(topic: string): { readonly transforms: Transforms; release(): void } {
    const namespace = this.#namespace(topic);
    let tree = this.#trees.get(namespace);
    if (tree === undefined) {
      tree = { transforms: new Transforms(), subscriptions: [], users: 0 };
      this.#trees.set(namespace, tree);
      this.#subscribe(namespace, tree);
    }
    const used = tree;
    used.users += 1;
    return {
      transforms: used.transforms,
      release: () => {
        used.users -= 1;
        if (used.users > 0) return;
        for (const subscription of used.subscriptions) subscription.close();
        if (this.#trees.get(namespace) === used) this.#trees.delete(namespace);
      },
    };
  }

  /** Returns the pose of a frame in the world of a server at a time [s], or a sentence that says why there is none. */
  find(transforms: Transforms, world: World, frame: string, time: number | null): Located | string {
    const bodies = this.#bodies.get(world);
    const worldName = bodies?.worldName ?? "world";
    const name = frame.replace(/^\//, "");
    if (name === "") return "The message names no frame.";
    const located = transforms.find(name, time, worldName, (known) => bodies?.find(known, time) ?? null);
    return located ?? `No transform from ${name} to ${worldName}.`;
  }

  #topics(): TopicEntry[] {
    return this.interfaces.topics.filter(({ type, publishers }) => type === TF && publishers > 0);
  }

  /** Returns the longest namespace with transforms that contains the topic. */
  #namespace(topic: string): string {
    const namespaces = this.#topics().map(({ name }) => namespaceOf(name));
    const matching = namespaces.filter((namespace) => topic.startsWith(`${namespace}/`));
    return matching.sort((a, b) => b.length - a.length)[0] ?? namespaces[0] ?? "";
  }

  #subscribe(namespace: string, tree: Tree): void {
    for (const { name } of this.#topics()) {
      if (namespaceOf(name) !== namespace) continue;
      const fixed = name.endsWith("_static");
      const receive = (received: Sample[]) => {
        for (const { message } of received) add(tree.transforms, message["transforms"] as TransformStamped[], fixed);
      };
      const warn = (sentence: string) => this.app.shell.notice(`${name}: ${sentence}`, "error");
      tree.subscriptions.push(samples(this.app.source, name, "all", receive, warn));
    }
  }

  /** Topics of transforms may appear after the first topic that needs them. */
  #resubscribe(): void {
    for (const [namespace, tree] of this.#trees) {
      if (tree.subscriptions.length === this.#topics().filter(({ name }) => namespaceOf(name) === namespace).length) {
        continue;
      }
      for (const subscription of tree.subscriptions.splice(0)) subscription.close();
      this.#subscribe(namespace, tree);
    }
  }
}

function namespaceOf(topic: string): string {
  return topic.slice(0, topic.lastIndexOf("/"));
}

function add(transforms: Transforms, received: readonly TransformStamped[], fixed: boolean): void {
  for (const { header, child_frame_id, transform } of received) {
    const { translation, rotation } = transform;
    transforms.add(header.frame_id, child_frame_id, seconds(header.stamp), pose(translation, rotation), fixed);
  }
}
