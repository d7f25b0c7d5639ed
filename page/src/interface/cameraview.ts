import type { App } from "../app.ts";
import type { World } from "../scene/world.ts";
import { button, select, toggle } from "./controls.ts";
import { element } from "./element.ts";
import { bodyName } from "./selection.ts";

const FREE = "free";
const GROUP = "Camera";

/** Adds what concerns the camera of the page: fit, follow, cameras of the models, and how bodies are drawn. */
export function install(app: App): void {
  const { shell, stage, selection, servers } = app;
  let followed: { world: World; body: number } | null = null;
  const fit = button({ icon: "fit", label: "Fit the model into the picture", key: "F", run: () => fitAll() });
  const follow = button({ icon: "follow", label: "Follow", key: "G", run: () => setFollow(followed === null) });
  const cameras = select({ label: "Camera", options: [], change: (value) => look(value) });
  const home = button({ icon: "home", text: "Reset camera", key: "Home", run: () => resetCamera() });
  const fitSelected = button({ icon: "fit", text: "Fit selection", key: "Shift + F", run: () => fitSelection() });
  const transparent = toggle({
    text: "Transparent",
    hint: "Draws bodies that can move as transparent",
    change: (on) => all((world) => world.setTransparent(on)),
  });
  const wireframe = toggle({ text: "Wireframe", change: (on) => all((world) => world.setWireframe(on)) });
  shell.tool("view", element("div", { className: "joined" }, fit.element, follow.element));
  const content = shell.panel("View", { icon: "eye", order: 10, open: true });
  content.append(
    cameras.element,
    element("div", { className: "row" }, fitSelected.element, home.element),
    element("div", { className: "columns" }, transparent.element, wireframe.element),
  );
  shell.shortcut({ key: "f", text: "Fit the model into the picture", group: GROUP, run: () => fitAll() });
  shell.shortcut({ key: "f", shift: true, text: "Fit the selected body", group: GROUP, run: () => fitSelection() });
  shell.shortcut({
    key: "g",
    text: "Follow the selected body, or end it",
    group: GROUP,
    run: () => follow.element.click(),
  });
  shell.shortcut({ key: "c", text: "Next camera of the model", group: GROUP, run: () => nextCamera() });
  shell.shortcut({ key: "Home", text: "Reset the camera", group: GROUP, run: () => resetCamera() });

  function current(): World | undefined {
    const { current } = servers;
    return current === null ? undefined : stage.worlds.get(current.id);
  }
  function all(change: (world: World) => void): void {
    for (const world of stage.worlds.values()) change(world);
    stage.invalidate();
  }
  function fitAll(): void {
    look(FREE);
    stage.fit(undefined, current());
  }
  function fitSelection(): void {
    const selected = selection.current;
    if (selected === null) return shell.notice("Select a body first.");
    look(FREE);
    stage.fit(subtree(selected.world, selected.body), selected.world);
  }
  function resetCamera(): void {
    setFollow(false);
    look(FREE);
    stage.resetCamera(current());
  }
  function setFollow(on: boolean): void {
    const before = followed;
    followed = on ? (selection.current ?? firstMoving(current())) : null;
    if (followed !== null) {
      look(FREE);
      stage.follow(followed.world, followed.body);
      shell.notice(`The camera follows ${bodyName(followed.world, followed.body)}.`);
    } else if (before !== null) {
      stage.follow(before.world, null);
    } else if (on) {
      shell.notice("No body of this model can move.");
    }
    follow.press(followed !== null);
    const name = followed === null ? "the selected body" : bodyName(followed.world, followed.body);
    follow.set({ label: followed === null ? `Follow ${name}` : `Stop following ${name}` });
  }
  function look(value: string): void {
    cameras.value = value;
    const world = current();
    if (world === undefined) return;
    stage.lookThrough(world, value === FREE ? null : Number(value));
  }
  function nextCamera(): void {
    const count = cameras.select.options.length;
    if (count < 2) return shell.notice("This model has no cameras.");
    const next = cameras.select.options[(cameras.select.selectedIndex + 1) % count]!;
    look(next.value);
    shell.notice(next.text);
  }
  function listCameras(): void {
    const names = current()?.pack.header.cameras ?? [];
    const choices = names.map(({ name }, index) => ({ value: `${index}`, text: name || `camera ${index}` }));
    cameras.set([{ value: FREE, text: "Free camera" }, ...choices]);
    cameras.disable(choices.length === 0 ? "This model has no cameras." : null);
  }
  setFollow(false);
  servers.listen(listCameras);
  stage.onWorld((world) => {
    if (transparent.value) world.setTransparent(true);
    if (wireframe.value) world.setWireframe(true);
    if (followed?.world.server === world.server) setFollow(false);
    listCameras();
    if (world === current()) cameras.value = FREE;
  });
  stage.onRemove((world) => followed?.world === world && setFollow(false));
  let outlined: World | null = null;
  selection.listen((selected) => {
    if (outlined !== selected?.world) outlined?.outline(null);
    outlined = selected?.world ?? null;
    outlined?.outline(selected!.body);
    stage.invalidate();
    fitSelected.disable(selected === null ? "no body is selected." : null);
    if (followed !== null && selected !== null) setFollow(true);
  });
  fitSelected.disable("no body is selected.");
}

/** Returns a body and all bodies below it. */
function subtree(world: World, body: number): number[] {
  const inside = new Set([body]);
  // A parent comes before its children.
  world.pack.header.bodies.forEach(({ parent }, id) => id !== 0 && inside.has(parent) && inside.add(id));
  return [...inside];
}

function firstMoving(world: World | undefined): { world: World; body: number } | null {
  const body = world?.pack.header.moving[0];
  return world === undefined || body === undefined ? null : { world, body };
}
