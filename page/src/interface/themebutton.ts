import type { App } from "../app.ts";
import { button } from "./controls.ts";
import type { Theme } from "./theme.ts";

const LABELS: Readonly<Record<Theme, string>> = {
  system: "Colours of the system",
  dark: "Dark colours",
  light: "Light colours",
};

/** Adds the switch between dark and light. */
export function install({ shell }: App): void {
  const { themes } = shell;
  const show = () => created.set({ icon: themes.current, label: `${LABELS[themes.current]}; click to change` });
  const created = button({
    icon: themes.current,
    label: "",
    className: "bare",
    run: () => {
      themes.next();
      show();
    },
  });
  show();
  shell.tool("page", created.element);
}
