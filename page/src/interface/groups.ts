import type { App } from "../app.ts";
import { GROUP_KINDS, type GroupKind, VISIBLE_GROUPS } from "../scene/part.ts";
import { button } from "./controls.ts";
import { element } from "./element.ts";

const TEXTS: Readonly<Record<GroupKind, string>> = { geom: "Geoms", site: "Sites", skin: "Skins", flex: "Flexes" };

/** Adds the switches of MuJoCo's groups; only groups that contain anything are listed. */
export function install({ shell, stage }: App): void {
  const content = shell.panel("Groups", { icon: "tree", order: 30 });
  const visible = new Map<string, boolean>();
  const isVisible = (kind: GroupKind, group: number) => visible.get(`${kind} ${group}`) ?? group < VISIBLE_GROUPS;
  const set = (kind: GroupKind, group: number, on: boolean) => {
    visible.set(`${kind} ${group}`, on);
    for (const world of stage.worlds.values()) world.setGroup(kind, group, on);
    stage.invalidate();
  };
  const draw = () => {
    const worlds = [...stage.worlds.values()];
    const rows = GROUP_KINDS.flatMap((kind) => {
      const groups = [...new Set(worlds.flatMap((world) => world.usedGroups(kind)))].sort((a, b) => a - b);
      if (groups.length === 0) return [];
      const buttons = groups.map((group) => {
        const created = button({
          text: `${group}`,
          label: `${TEXTS[kind]} of group ${group}`,
          run: () => {
            set(kind, group, !isVisible(kind, group));
            created.press(isVisible(kind, group));
          },
        });
        created.element.setAttribute("aria-label", `${TEXTS[kind]} of group ${group}`);
        created.press(isVisible(kind, group));
        return created.element;
      });
      return [element("span", {}, TEXTS[kind]), element("div", { className: "row" }, ...buttons)];
    });
    const hint = element(
      "p",
      { className: "hint" },
      rows.length === 0 ? "No model is loaded yet." : "Pressed is visible.",
    );
    content.replaceChildren(element("div", { className: "grouprows" }, ...rows), hint);
  };
  draw();
  stage.onWorld((world) => {
    for (const kind of GROUP_KINDS) {
      for (const group of world.usedGroups(kind)) world.setGroup(kind, group, isVisible(kind, group));
    }
    draw();
  });
}
