import { button, explainWith } from "./controls.ts";
import { element, uniqueId } from "./element.ts";
import { FloatingWindows, type Floating, type FloatingOptions } from "./floating.ts";
import { icon } from "./icons.ts";
import { Panels, type PanelOptions } from "./panels.ts";
import type { Settings } from "./settings.ts";
import { type Focus, type Gesture, type Shortcut, Shortcuts } from "./shortcuts.ts";
import { Themes } from "./theme.ts";

/** Groups of the toolbar, from left to right. */
export type Group = "server" | "time" | "view" | "page";

const NOTICE_TIME = { information: 4000, error: 9000 };
/** Narrower windows show one side at first [px]. */
const WIDE = 1180;
/** Narrower windows show the panels in a sheet at the bottom; as in style.css. */
const PHONE = matchMedia("(max-width: 719px)");

/** The frame of the page: toolbar above, panels at the sides, status line below, the scene in the middle. */
export class Shell {
  readonly stageElement = element("main", { className: "stage", id: "stage" });
  readonly toolbar = element("header", { className: "toolbar" });
  readonly status = element("footer", { className: "status" });
  readonly shortcuts = new Shortcuts();
  readonly themes: Themes;
  readonly panels: Panels;
  readonly #windows = new FloatingWindows();
  readonly #notices = element("div", { className: "notices" });
  readonly #groups: Record<Group, HTMLElement>;
  /** Show or hide the panels. */
  readonly #flips: Record<"left" | "right" | "sheet", () => void>;

  constructor(
    readonly body: HTMLElement,
    readonly settings: Settings,
  ) {
    this.themes = new Themes(settings);
    this.panels = new Panels(settings);
    this.shortcuts.characters = settings.get("shortcuts", true);
    const group = (name: string) => element("div", { className: `group ${name}` });
    this.#groups = { server: group("server"), time: group("time"), view: group("view"), page: group("page") };
    this.toolbar.append(...Object.values(this.#groups));
    this.#notices.setAttribute("role", "status");
    this.#windows.element.append(this.#notices);
    this.stageElement.append(this.#windows.element);
    body.append(this.toolbar, this.panels.element, this.stageElement, this.status);
    explainWith((reason) => this.notice(reason));
    document.addEventListener("keydown", (event) => this.#key(event));
    this.#flips = { left: this.#sideButton("left"), right: this.#sideButton("right"), sheet: this.#sheetButton() };
  }

  /** Adds a panel to a side that the user can fold; returns the element for its content. */
  panel(title: string, options: PanelOptions = {}): HTMLElement {
    return this.panels.add(title, options);
  }

  /** Unfolds a panel and shows its side. */
  reveal(title: string): void {
    const side = this.panels.reveal(title);
    if (side !== null && this.body.classList.contains(`no-${side}`)) this.#flips[side]();
    if (this.phone && !this.body.classList.contains("sheet")) this.#flips.sheet();
    this.panels.reveal(title);
  }

  /** Opens a window above the scene. */
  window(title: string, options: FloatingOptions = {}): Floating {
    return this.#windows.open(title, options);
  }

  /** Adds elements to a group of the toolbar. */
  tool(group: Group, ...elements: HTMLElement[]): void {
    this.#groups[group].append(...elements);
  }

  shortcut(shortcut: Shortcut): void {
    this.shortcuts.add(shortcut);
  }

  /** Adds a line to the help. */
  gesture(gesture: Gesture): void {
    this.shortcuts.gesture(gesture);
  }

  /** Shows a sentence for a few seconds; the same sentence is shown once. */
  notice(text: string, kind: "information" | "error" = "information"): void {
    for (const shown of [...this.#notices.children]) if (shown.textContent === text) shown.remove();
    const notice = element("div", { className: `notice ${kind}` }, element("span", {}, text));
    if (kind === "error") notice.prepend(icon("warning"));
    const close = button({ icon: "close", label: "Close the notice", className: "bare", run: () => notice.remove() });
    notice.append(close.element);
    this.#notices.append(notice);
    while (this.#notices.children.length > 4) this.#notices.firstElementChild?.remove();
    setTimeout(() => notice.remove(), NOTICE_TIME[kind]);
  }

  /** Runs a request; an error becomes a notice. */
  async attempt(work: () => Promise<unknown>): Promise<boolean> {
    try {
      await work();
      return true;
    } catch (error) {
      this.notice(error instanceof Error ? error.message : String(error), "error");
      return false;
    }
  }

  /** Opens a modal dialog; Escape and its button close it. */
  dialog(title: string, ...content: (Node | string)[]): HTMLDialogElement {
    const heading = element("h2", { id: uniqueId("dialog") }, title);
    const dialog = element("dialog");
    dialog.setAttribute("aria-labelledby", heading.id);
    const close = button({ icon: "close", label: "Close", className: "bare", run: () => dialog.close() });
    dialog.append(element("header", {}, heading, close.element), element("div", { className: "content" }, ...content));
    dialog.addEventListener("close", () => dialog.remove());
    // A click beside the dialog hits the dialog element itself, not its content.
    dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
    this.body.append(dialog);
    dialog.showModal();
    return dialog;
  }

  #sideButton(side: "left" | "right"): () => void {
    const { settings, body } = this;
    const text = side === "left" ? "Show the model panels" : "Show the view panels";
    const key = side === "left" ? "[" : "]";
    const flip = () => {
      const open = body.classList.contains(`no-${side}`);
      settings.set(`side.${side}`, open);
      set(open);
    };
    const created = button({ icon: side, label: text, key, className: `bare desk ${side}`, run: flip });
    const set = (open: boolean) => {
      body.classList.toggle(`no-${side}`, !open);
      created.press(open);
      created.element.setAttribute("aria-expanded", String(open));
    };
    created.element.setAttribute("aria-controls", this.panels.sides[side].id);
    this.tool(side === "left" ? "server" : "page", created.element);
    this.shortcut({ key, text, group: "Page", run: flip });
    set(settings.get(`side.${side}`, window.innerWidth >= WIDE || side === "right"));
    return flip;
  }

  #sheetButton(): () => void {
    const flip = () => {
      const open = this.body.classList.toggle("sheet");
      created.press(open);
      created.element.setAttribute("aria-expanded", String(open));
    };
    const created = button({ icon: "panels", label: "Show the panels", className: "bare phone", run: flip });
    created.press(false);
    this.tool("page", created.element);
    return flip;
  }

  /** Whether the window is as narrow as a phone. */
  get phone(): boolean {
    return PHONE.matches;
  }

  #key(event: KeyboardEvent): void {
    if (event.defaultPrevented || document.querySelector("dialog[open]") !== null) return;
    const shortcut = this.shortcuts.find(event, focusOf(event.target));
    if (shortcut !== undefined) {
      event.preventDefault();
      shortcut.run();
    }
  }
}

function focusOf(target: EventTarget | null): Focus {
  if (!(target instanceof Element)) return "none";
  if (target.closest("textarea, [contenteditable], select") !== null) return "field";
  const input = target.closest("input");
  if (input !== null) return ["checkbox", "radio", "button"].includes(input.type) ? "control" : "field";
  return target.closest("button, summary, a, [role=tree], [tabindex='0']") === null ? "none" : "control";
}
