import type { App } from "../app.ts";
import type { World } from "../scene/world.ts";
import { field, select } from "./controls.ts";
import { element } from "./element.ts";
import { bodyName } from "./selection.ts";
import { TreeView } from "./treeview.ts";

/** Adds the tree of all bodies, with a search. */
export function install(app: App): void {
  const { shell, stage, selection, servers, source } = app;
  const content = shell.panel("Bodies", { side: "left", icon: "tree", order: 20, open: !shell.phone });
  let world: World | null = null;
  const tree = new TreeView("Bodies", (body) => world !== null && selection.select({ world, body }));
  const search = field({
    label: "Search bodies",
    placeholder: "Search bodies",
    type: "search",
    change: (text) => tree.search(text),
  });
  const model = select({ label: "Server", options: [], change: (id) => show(stage.worlds.get(Number(id)) ?? null) });
  const empty = element("p", { className: "hint" }, "No model is loaded yet.");
  search.input.addEventListener("keydown", (event) => {
    if (event.key === "ArrowDown") tree.element.focus();
    else if (event.key === "Enter") tree.choose();
    else return;
    event.preventDefault();
  });
  content.append(model.element, search.element, tree.element, empty);
  shell.shortcut({
    key: "/",
    text: "Search bodies",
    group: "Selection",
    run: () => {
      shell.reveal("Bodies");
      search.input.focus();
    },
  });

  function show(next: World | null): void {
    world = next;
    empty.hidden = next !== null;
    for (const part of [search.element, tree.element]) part.hidden = next === null;
    if (next === null) return;
    const { bodies } = next.pack.header;
    tree.show(
      bodies.map(({ parent }) => parent),
      bodies.map((_, body) => bodyName(next, body)),
    );
    search.input.value = "";
    tree.search("");
    const { current } = selection;
    tree.select(current?.world === next ? current.body : null);
  }
  function update(): void {
    const shown = source.servers.filter(({ id }) => servers.isShown(id) && stage.worlds.has(id));
    model.element.hidden = shown.length < 2;
    model.set(shown.map(({ id, name }) => ({ value: `${id}`, text: name })));
    const wanted = shown.find(({ id }) => id === world?.server)?.id ?? servers.current?.id;
    const next = wanted === undefined ? null : (stage.worlds.get(wanted) ?? null);
    if (next !== world || next === null) show(next);
    if (next !== null) model.value = `${next.server}`;
  }
  servers.listen(update);
  stage.onWorld(update);
  selection.listen((selected) => {
    if (selected !== null && selected.world !== world) show(selected.world);
    tree.select(selected?.body ?? null);
    if (selected !== null) model.value = `${selected.world.server}`;
  });
}
