import type { App } from "../app.ts";
import { field, toggle, type Toggle } from "../interface/controls.ts";
import { element, setText } from "../interface/element.ts";
import { fixed } from "../interface/format.ts";
import type { TopicEntry } from "../wire/protocol.ts";
import type { FrameFinder } from "./frames.ts";
import { type ImageWindows, isImage } from "./images.ts";
import type { InterfaceList } from "./interfaces.ts";
import { isDisplayed, Layer } from "./layers.ts";

interface Row {
  readonly entry: TopicEntry;
  readonly element: HTMLElement;
  readonly toggle: Toggle;
  readonly status: HTMLElement;
  readonly options: HTMLElement;
  /** Folds the options. */
  readonly fold: HTMLElement;
}

/** The panel with the topics that can be shown in the scene or as pictures. What is shown survives a reload. */
export class TopicPanel {
  readonly #content: HTMLElement;
  readonly #list = element("div", { className: "topics" });
  readonly #empty = element("p", { className: "hint" });
  readonly #rows = new Map<string, Row>();
  readonly #layers = new Map<string, Layer>();
  readonly #wanted: Set<string>;
  #filter = "";
  #colours = 0;

  constructor(
    readonly app: App,
    readonly interfaces: InterfaceList,
    readonly finder: FrameFinder,
    readonly images: ImageWindows,
  ) {
    const { shell, settings } = app;
    this.#wanted = new Set(settings.get<string>("topics.shown", "").split(" ").filter(Boolean));
    this.#content = shell.panel("Topics", {
      icon: "topic",
      order: 40,
      onToggle: (open) => interfaces.use(this, open || this.#wanted.size > 0),
    });
    const search = field({
      label: "Search topics",
      placeholder: "Search",
      type: "search",
      change: (text) => this.#search(text),
    });
    this.#content.append(search.element, this.#list, this.#empty);
    interfaces.use(this, this.#wanted.size > 0);
    interfaces.listen(() => this.#refresh());
    images.onClose = (topic) => this.#show(topic, false);
    setInterval(() => this.#describe(), 500);
    app.stage.beforeDraw(() => {
      for (const layer of this.#layers.values()) layer.update();
    });
    this.#refresh();
  }

  /** Names of the topics that are shown, for tests. */
  get shown(): string[] {
    return [...this.#layers.keys(), ...this.images.shown];
  }

  #refresh(): void {
    const { topics } = this.interfaces;
    const entries = topics.filter(
      ({ name, type, publishers }) =>
        publishers > 0 &&
        (isDisplayed(type) || isImage(type)) &&
        // Static transforms are part of the display of the others.
        !(name.endsWith("_static") && topics.some((other) => `${other.name}_static` === name)),
    );
    for (const [name, row] of this.#rows) {
      // A topic of a server that has left stays while it is shown, and is shown again when the server returns.
      if (entries.some((entry) => entry.name === name) || row.toggle.value) continue;
      row.element.remove();
      this.#rows.delete(name);
    }
    for (const entry of entries) if (!this.#rows.has(entry.name)) this.#add(entry);
    const order = [...this.#rows.keys()].sort();
    const wanted = order.map((name) => this.#rows.get(name)!.element);
    if (wanted.some((row, index) => this.#list.children[index] !== row)) this.#list.replaceChildren(...wanted);
    setText(this.#empty, this.#rows.size > 0 ? "" : NOTHING);
    this.#search(this.#filter);
  }

  #add(entry: TopicEntry): void {
    const { name, type } = entry;
    const control = toggle({ text: name, hint: type, change: (on) => this.#show(name, on) });
    const status = element("p", { className: "hint topic-status" });
    const options = element("div", {});
    const fold = element(
      "details",
      { className: "topic-options", hidden: true },
      element("summary", {}, "Options"),
      options,
    );
    const row = element("div", { className: "topic" }, control.element, status, fold);
    this.#rows.set(name, { entry, element: row, toggle: control, status, options, fold });
    setText(status, shortType(type));
    if (this.#wanted.has(name)) this.#show(name, true);
  }

  #search(text: string): void {
    this.#filter = text;
    const words = text.toLowerCase().split(/\s+/);
    for (const { entry, element: row } of this.#rows.values()) {
      const line = `${entry.name} ${entry.type}`.toLowerCase();
      row.hidden = !words.every((word) => line.includes(word));
    }
  }

  #show(name: string, on: boolean): void {
    const row = this.#rows.get(name);
    if (row === undefined) return;
    row.toggle.value = on;
    on ? this.#wanted.add(name) : this.#wanted.delete(name);
    this.app.settings.set("topics.shown", [...this.#wanted].join(" "));
    if (isImage(row.entry.type)) {
      on ? this.images.open(row.entry) : this.images.close(name);
    } else if (on && !this.#layers.has(name)) {
      const layer = new Layer(this.app, row.entry, this.finder, this.#colours);
      this.#colours += 1;
      this.#layers.set(name, layer);
      const controls = (layer.display.controls?.() ?? []).map((control) => control.element);
      row.options.replaceChildren(...controls);
    } else if (!on) {
      this.#layers.get(name)?.close();
      this.#layers.delete(name);
    }
    row.fold.hidden = !this.#layers.has(name) || row.options.childElementCount === 0;
    this.#describe();
  }

  #describe(): void {
    for (const [name, { entry, status }] of this.#rows) {
      const layer = this.#layers.get(name);
      const picture = this.images.describe(name);
      const rate = layer?.rate.hertz() ?? null;
      const parts = [shortType(entry.type)];
      if (layer !== undefined) {
        const summary = layer.display.summary?.() ?? "";
        if (summary !== "") parts.push(summary);
        if (rate !== null) parts.push(`${fixed(rate, 1)} Hz`);
      }
      const problem = layer?.problem || picture;
      status.classList.toggle("problem", problem !== "");
      setText(status, problem === "" ? parts.join(" · ") : problem);
    }
  }
}

const NOTHING =
  "No server publishes a topic that can be shown: scans, point clouds, markers, transforms, odometry, paths, poses or images.";

function shortType(type: string): string {
  return type.slice(type.lastIndexOf("/") + 1);
}
