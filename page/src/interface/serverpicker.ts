import type { App } from "../app.ts";
import { select, slider, toggle } from "./controls.ts";
import { element } from "./element.ts";
import { icon } from "./icons.ts";
import { connection } from "./status.ts";

/** Adds the name of the server, the list of servers if there are several, and the states in which there is no picture. */
export function install(app: App): void {
  const { shell, source, servers, settings, stage } = app;
  const dot = element("span", { className: "dot" });
  const name = element("span", { className: "name" });
  const picker = select({
    label: "Server that the toolbar controls",
    options: [],
    compact: true,
    change: (value) => servers.choose(Number(value)),
  });
  const brand = element("div", { className: "brand" }, dot, name);
  shell.tool("server", brand, picker.element);
  const list = shell.panel("Servers", { side: "left", icon: "server", order: 10, open: true });
  const panel = list.parentElement!;
  const rows = element("div", { className: "rows" });
  const place = (distance: number) =>
    source.servers.forEach(({ id }, index) => stage.setOffset(id, [index * distance, 0, 0]));
  const distance = slider({
    label: "Distance",
    unit: "m",
    min: 0,
    max: 10,
    step: 0.1,
    decimals: 1,
    value: settings.get("distance", 0),
    change: place,
    commit: (value) => settings.set("distance", value),
  });
  distance.element.title = "Distance between the servers in the scene, along x";
  list.append(
    rows,
    element("p", { className: "hint" }, "All checked servers are drawn in one scene."),
    distance.element,
  );
  const curtain = element("div", { className: "curtain" });
  const banner = element("div", { className: "banner" });
  for (const part of [curtain, banner]) part.setAttribute("role", "status");
  shell.stageElement.append(curtain, banner);

  let shown = "";
  function update(): void {
    const several = source.servers.length > 1;
    const { text, tone } = connection(app);
    dot.dataset["tone"] = tone;
    dot.title = text;
    name.textContent = servers.current?.name ?? "mjplug";
    name.hidden = several;
    picker.element.hidden = !several;
    panel.hidden = !several;
    const key = JSON.stringify([
      source.servers,
      servers.current?.id,
      source.servers.map(({ id }) => servers.isShown(id)),
    ]);
    if (key !== shown) {
      shown = key;
      picker.set(source.servers.map((entry) => ({ value: `${entry.id}`, text: label(entry) })));
      picker.value = `${servers.current?.id}`;
      rows.replaceChildren(...source.servers.map((entry) => row(app, entry.id, label(entry))));
      place(distance.value);
    }
    showState();
  }
  function showState(): void {
    const { current } = servers;
    const drawn = current !== null && stage.worlds.has(current.id);
    const { text, tone } = connection(app);
    curtain.hidden = drawn;
    banner.hidden = !drawn || tone === "ok";
    if (banner.textContent !== text) banner.replaceChildren(icon("warning"), text);
    shell.stageElement.classList.toggle("stale", drawn && tone !== "ok");
    if (drawn) return;
    const waiting = tone === "ok";
    const title = waiting ? "Loading the model …" : current === null && source.state.connected ? "No server" : text;
    const hint = waiting
      ? size(servers.info?.scene_bytes ?? 0)
      : source.state.connected
        ? "Start one: mjplug serve bundled:quadruped"
        : "Start it again: mjplug view. This page then connects by itself.";
    if (curtain.dataset["key"] === title + hint) return;
    curtain.dataset["key"] = title + hint;
    curtain.replaceChildren(icon(waiting ? "layers" : "server"), element("h2", {}, title), element("p", {}, hint));
  }
  servers.listen(update);
  stage.onWorld(showState);
}

function row(app: App, server: number, text: string): HTMLElement {
  const { servers } = app;
  const created = toggle({
    text,
    value: servers.isShown(server),
    change: (on) => servers.show(server, on),
  });
  if (servers.current?.id === server) created.disable("The toolbar controls this server, so it is shown.");
  return created.element;
}

function label({ name, connected }: { name: string; connected: boolean }): string {
  return connected ? name : `${name} (gone)`;
}

function size(bytes: number): string {
  return bytes > 0 ? `${(bytes / 1e6).toFixed(bytes < 1e7 ? 2 : 1)} MB` : "";
}
