import { element, uniqueId } from "./element.ts";
import { icon, type IconName } from "./icons.ts";
import type { Settings } from "./settings.ts";

export interface PanelOptions {
  /** Left: what the model is. Right: what is shown and done; the default. */
  readonly side?: "left" | "right";
  readonly icon?: IconName;
  /** Whether it is open until the user folds it; the browser remembers what the user did. */
  readonly open?: boolean;
  /** Position among the panels of a side; smaller is higher. Default: 100. */
  readonly order?: number;
  /** Called when the panel is unfolded or folded, and soon after its creation. */
  onToggle?(open: boolean): void;
}

/** The panels at both sides; on a phone, all of them are in a sheet at the bottom. */
export class Panels {
  readonly element = element("div", { className: "sides" });
  readonly sides = {
    left: element("aside", { className: "side left", ariaLabel: "Model", id: uniqueId("side") }),
    right: element("aside", { className: "side right", ariaLabel: "View and tools", id: uniqueId("side") }),
  };
  readonly #panels = new Map<string, HTMLDetailsElement>();

  constructor(readonly settings: Settings) {
    this.element.append(this.sides.left, this.sides.right);
  }

  /** Adds a panel and returns the element for its content. */
  add(title: string, options: PanelOptions): HTMLElement {
    const content = element("div", { className: "content" });
    const summary = element("summary", {}, element("span", { className: "picture" }, icon(options.icon ?? "layers")));
    summary.append(element("span", { className: "title" }, title), icon("chevron"));
    const name = `panel.${title}`;
    const panel = element("details", { className: "panel" }, summary, content);
    panel.open = this.settings.get(name, options.open ?? false);
    panel.addEventListener("toggle", () => {
      this.settings.set(name, panel.open);
      options.onToggle?.(panel.open);
    });
    const order = options.order ?? 100;
    panel.dataset["order"] = `${order}`;
    const side = this.sides[options.side ?? "right"];
    const next = [...side.children].find((other) => Number((other as HTMLElement).dataset["order"]) > order);
    side.insertBefore(panel, next ?? null);
    this.#panels.set(title, panel);
    return content;
  }

  /** Unfolds a panel, brings it into view, and returns its side; null if there is no such panel. */
  reveal(title: string): "left" | "right" | null {
    const panel = this.#panels.get(title);
    if (panel === undefined) return null;
    panel.open = true;
    panel.scrollIntoView({ block: "nearest" });
    return panel.parentElement === this.sides.left ? "left" : "right";
  }
}
