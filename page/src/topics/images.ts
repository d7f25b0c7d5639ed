import type { App } from "../app.ts";
import { element, setText } from "../interface/element.ts";
import { fixed, formatAge, formatTime } from "../interface/format.ts";
import type { TopicEntry } from "../wire/protocol.ts";
import type { Picture } from "../wire/source.ts";
import { type Live, pictures } from "./live.ts";
import { PictureLoader } from "./pictureloader.ts";
import { Rate } from "./rate.ts";

const TYPES = new Set(["sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"]);

export function isImage(type: string): boolean {
  return TYPES.has(type);
}

/** The newest picture of a topic, with its time, rate and age. */
class ImageView {
  readonly image = element("img", { className: "picture-image" });
  readonly caption = element("p", { className: "picture-caption" }, "Waiting for an image …");
  readonly element: HTMLElement;
  readonly #rate = new Rate();
  readonly #loader = new PictureLoader(this.image);
  readonly #live: Live;
  #time = 0;
  #size = "";
  problem = "";

  constructor(
    readonly app: App,
    readonly topic: TopicEntry,
  ) {
    this.image.alt = `Image of ${topic.name}`;
    this.image.hidden = true;
    this.element = element("figure", { className: "picture-view" }, this.image, this.caption);
    this.#live = pictures(
      app.source,
      topic.name,
      (picture) => this.#show(picture),
      (sentence) => (this.problem = sentence),
    );
  }

  describe(): void {
    if (this.problem !== "" && this.image.hidden) {
      setText(this.caption, this.problem);
    } else if (!this.image.hidden) {
      const now = this.app.stage.worlds.get(this.topic.server)?.frame?.time;
      const rate = this.#rate.hertz();
      const age = now === undefined || this.#time === 0 ? "" : ` · ${formatAge(now - this.#time)} old`;
      const stamp = this.#time === 0 ? "no stamp" : formatTime(this.#time);
      setText(this.caption, `${stamp} · ${rate === null ? "–" : fixed(rate, 1)} Hz${age} · ${this.#size}`);
    }
  }

  close(): void {
    this.#live.close();
    this.element.remove();
    this.#loader.close();
  }

  #show({ file, width, height, time }: Picture): void {
    this.#rate.count();
    this.#time = time;
    this.#size = `${width} × ${height}`;
    this.problem = "";
    this.#loader.show(file);
    this.describe();
  }
}

interface Shown {
  readonly view: ImageView;
  /** Removes the window or the place in the strip. */
  remove(): void;
}

/** Pictures of cameras, in windows above the scene; on a phone, in a strip above the status line. */
export class ImageWindows {
  /** Called when the user closes a window. */
  onClose: (topic: string) => void = () => undefined;
  readonly #shown = new Map<string, Shown>();
  readonly #strip = element("div", { className: "picture-strip", hidden: true });

  constructor(readonly app: App) {
    app.shell.stageElement.append(this.#strip);
    setInterval(() => {
      for (const { view } of this.#shown.values()) view.describe();
    }, 250);
    matchMedia("(max-width: 719px)").addEventListener("change", () => this.#rearrange());
  }

  get shown(): string[] {
    return [...this.#shown.keys()];
  }

  /** Returns why a topic has no picture; empty if there is none to say. */
  describe(topic: string): string {
    return this.#shown.get(topic)?.view.problem ?? "";
  }

  open(topic: TopicEntry): void {
    if (this.#shown.has(topic.name)) return;
    const view = new ImageView(this.app, topic);
    this.#shown.set(topic.name, { view, remove: this.#place(view) });
  }

  close(topic: string): void {
    const shown = this.#shown.get(topic);
    if (shown === undefined) return;
    this.#shown.delete(topic);
    shown.view.close();
    shown.remove();
    this.#strip.hidden = this.#strip.childElementCount === 0;
  }

  #place(view: ImageView): () => void {
    const { name } = view.topic;
    if (this.app.shell.phone) {
      const title = element("figcaption", {}, name);
      const item = element("div", { className: "picture-item" }, title, view.element);
      this.#strip.append(item);
      this.#strip.hidden = false;
      return () => item.remove();
    }
    let open = true;
    const window = this.app.shell.window(name, {
      width: 336,
      height: 276,
      onClose: () => {
        const byUser = open;
        open = false;
        if (byUser) this.onClose(name);
      },
    });
    window.content.classList.add("picture-content");
    window.content.append(view.element);
    return () => {
      if (!open) return;
      open = false;
      window.close();
    };
  }

  /** Moves the pictures between windows and the strip. */
  #rearrange(): void {
    for (const [name, { view, remove }] of [...this.#shown]) {
      remove();
      this.#shown.set(name, { view, remove: this.#place(view) });
    }
    this.#strip.hidden = this.#strip.childElementCount === 0;
  }
}
