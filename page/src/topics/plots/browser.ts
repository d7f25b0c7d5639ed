import type { App } from "../../app.ts";
import { field } from "../../interface/controls.ts";
import { element, setText } from "../../interface/element.ts";
import { fixed } from "../../interface/format.ts";
import type { Fields, TopicEntry } from "../../wire/protocol.ts";
import { type Live, samples } from "../live.ts";
import { listFields, type NumberField } from "./fields.ts";
import { unitOf } from "./units.ts";

/** Time after which the dialog says that no message has come [ms]. */
const SILENCE = 2000;

/** Types that contain no numbers that anybody would plot. */
const EXCLUDED = new Set(["sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage", "std_msgs/msg/String"]);

/** A dialog to choose a field: first a topic, then a number of its newest message. */
export class FieldBrowser {
  readonly #topics = element("div", { className: "choices", role: "listbox", ariaLabel: "Topics" });
  readonly #fields = element("div", { className: "choices", role: "listbox", ariaLabel: "Fields" });
  readonly #hint = element("p", { className: "hint" }, "Choose a topic.");
  readonly #cells = new Map<string, HTMLElement>();
  #live: Live | null = null;
  #topic: TopicEntry | null = null;
  #filter = "";

  /** @param choose - Called with each field that the user chooses. */
  constructor(
    readonly app: App,
    topics: readonly TopicEntry[],
    readonly choose: (topic: string, path: string) => void,
  ) {
    const search = field({
      label: "Search topics and fields",
      placeholder: "Search",
      type: "search",
      change: (text) => this.#search(text),
    });
    const columns = element("div", { className: "browser" }, this.#topics, this.#fields);
    const dialog = app.shell.dialog("Plot a field", search.element, columns, this.#hint);
    dialog.addEventListener("close", () => this.#live?.close());
    for (const topic of topics) {
      if (topic.publishers === 0 || EXCLUDED.has(topic.type)) continue;
      const type = topic.type.slice(topic.type.lastIndexOf("/") + 1);
      const choice = element("button", { type: "button", className: "choice", role: "option" }, topic.name);
      choice.append(element("span", { className: "unit" }, type));
      choice.dataset["text"] = `${topic.name} ${type}`.toLowerCase();
      choice.addEventListener("click", () => this.#open(topic, choice));
      this.#topics.append(choice);
    }
  }

  #open(topic: TopicEntry, choice: HTMLElement): void {
    for (const other of this.#topics.children) other.setAttribute("aria-selected", String(other === choice));
    this.#live?.close();
    this.#topic = topic;
    this.#cells.clear();
    this.#fields.replaceChildren();
    setText(this.#hint, "Waiting for a message …");
    const fail = (sentence: string) => setText(this.#hint, sentence);
    this.#live = samples(
      this.app.source,
      topic.name,
      "newest",
      (received) => this.#show(received.at(-1)!.message),
      fail,
    );
    setTimeout(() => {
      if (this.#topic === topic && this.#cells.size === 0) {
        setText(
          this.#hint,
          "No message has arrived yet. The simulation may be paused, or the topic is published rarely.",
        );
      }
    }, SILENCE);
  }

  #show(message: Fields): void {
    const fields = listFields(message);
    for (const found of fields) this.#row(found);
    setText(this.#hint, fields.length === 0 ? "The message contains no numbers." : "Choose one or several fields.");
  }

  #row({ path, value }: NumberField): void {
    const topic = this.#topic!;
    let cell = this.#cells.get(path);
    if (cell === undefined) {
      cell = element("span", { className: "value" });
      this.#cells.set(path, cell);
      const name = element("span", {}, path);
      const unit = element("span", { className: "unit" }, unitOf(topic.type, path));
      const choice = element("button", { type: "button", className: "choice", role: "option" }, name, cell, unit);
      choice.dataset["text"] = path.toLowerCase();
      choice.addEventListener("click", () => {
        choice.setAttribute("aria-selected", "true");
        this.choose(topic.name, path);
      });
      this.#fields.append(choice);
      this.#hide(choice);
    }
    setText(cell, Number.isInteger(value) ? `${value}` : fixed(value, 4));
  }

  #search(text: string): void {
    this.#filter = text.toLowerCase();
    // While a topic is chosen, the search is for its fields.
    const list = this.#topic === null ? this.#topics : this.#fields;
    for (const choice of list.children) this.#hide(choice as HTMLElement);
  }

  #hide(choice: HTMLElement): void {
    choice.hidden = !this.#filter.split(/\s+/).every((word) => choice.dataset["text"]?.includes(word));
  }
}
