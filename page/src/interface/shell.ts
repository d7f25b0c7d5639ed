import { element } from "./element.ts";

/** A key that does something while no input field has the focus. */
export interface Shortcut {
  /** As in `KeyboardEvent.key`, such as "f" or "?". */
  readonly key: string;
  /** What it does, for the help, such as "Fit the robot into the picture". */
  readonly text: string;
  readonly group: string;
  run(): void;
}

/** The frame of the page: toolbar above, panels at the side, notices below, the canvas in the middle. */
export class Shell {
  readonly stageElement = element("div", { className: "stage" });
  readonly toolbar = element("div", { className: "toolbar" });
  readonly side = element("aside", { className: "side" });
  readonly notices = element("div", { className: "notices" });
  readonly shortcuts: Shortcut[] = [];

  constructor(body: HTMLElement) {
    this.toolbar.setAttribute("role", "toolbar");
    this.notices.setAttribute("role", "status");
    body.append(this.toolbar, this.stageElement, this.side, this.notices);
    document.addEventListener("keydown", (event) => this.#key(event));
  }

  /** Adds a panel to the side that the user can fold; returns the element for its content. */
  panel(title: string, open = false): HTMLElement {
    const content = element("div", { className: "content" });
    const details = element("details", { className: "panel", open }, element("summary", {}, title), content);
    this.side.append(details);
    return content;
  }

  shortcut(shortcut: Shortcut): void {
    this.shortcuts.push(shortcut);
  }

  /** Shows a sentence for a few seconds. */
  notice(text: string, kind: "information" | "error" = "information"): void {
    const notice = element("div", { className: `notice ${kind}` }, text);
    this.notices.append(notice);
    setTimeout(() => notice.remove(), 6000);
  }

  #key(event: KeyboardEvent): void {
    const target = event.target as HTMLElement | null;
    const typing = target?.closest("input, select, textarea, [contenteditable]") !== null;
    if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
    const shortcut = this.shortcuts.find(({ key }) => key === event.key);
    if (shortcut !== undefined) {
      event.preventDefault();
      shortcut.run();
    }
  }
}
