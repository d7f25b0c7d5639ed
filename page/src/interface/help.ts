import type { App } from "../app.ts";
import { button, toggle } from "./controls.ts";
import { element } from "./element.ts";

/** Adds the list of all shortcuts and gestures. */
export function install({ shell, settings }: App): void {
  const { shortcuts } = shell;
  const open = () => {
    const groups = [...shortcuts.help()].map(([group, entries]) => {
      const rows = entries.flatMap(({ keys, text }) => [element("dt", {}, ...keycaps(keys)), element("dd", {}, text)]);
      return element("section", {}, element("h3", {}, group), element("dl", {}, ...rows));
    });
    const letters = toggle({
      text: "Shortcuts with single keys",
      value: shortcuts.characters,
      hint: "Switch them off if a program or an input method uses the same keys.",
      change: (on) => {
        shortcuts.characters = on;
        settings.set("shortcuts", on);
      },
    });
    const note = element("p", { className: "hint" }, "Keys work while no input field has the focus.");
    shell.dialog("Shortcuts and gestures", element("div", { className: "help" }, ...groups), letters.element, note);
  };
  shell.tool("page", button({ icon: "help", label: "Help", key: "?", className: "bare", run: open }).element);
  shell.shortcut({ key: "?", text: "This help", group: "Page", run: open });
}

function keycaps(keys: string): (Node | string)[] {
  return keys.split(" + ").flatMap((key, index) => [index > 0 ? " + " : "", element("kbd", {}, key)]);
}
