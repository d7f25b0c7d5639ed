import type { App } from "../app.ts";
import { type Button, button, select } from "./controls.ts";
import { element } from "./element.ts";
import { formatSpeed } from "./format.ts";
import { icon } from "./icons.ts";
import { request, setParameter } from "./requests.ts";

const SPEEDS: readonly (number | "max")[] = [0.1, 0.25, 0.5, 1, 2, 5, "max"];
const STEPS = [1, 10, 100];
const OTHER = "other";
const GROUP = "Simulation";

/** Adds pause, steps, reset, keyframes and speed to the toolbar. */
export function install(app: App): void {
  const { shell, source, servers } = app;
  const call = (service: string, fields = {}) =>
    shell.attempt(async () => {
      const { current } = servers;
      if (current === null) throw new Error("There is no server yet.");
      await request(source, current.id, service, fields);
    });
  const pause = button({
    icon: "pause",
    label: "Pause",
    key: "Space",
    className: "strong",
    run: () => void call("~/set_pause", { paused: !servers.paused }),
  });
  const step = async (steps: number) => {
    if (!servers.paused && !(await call("~/set_pause", { paused: true }))) return;
    await call("~/step_simulation", { steps });
  };
  const steps = STEPS.map((count) => stepButton(count, () => void step(count)));
  const reset = button({
    icon: "reset",
    label: "Reset the world to its initial state",
    key: "Backspace",
    run: () => void call("~/reset_world", { keyframe: "" }),
  });
  const keyframes = select({
    label: "Reset to a keyframe",
    options: [],
    compact: true,
    change: (keyframe) => {
      keyframes.value = "";
      void call("~/reset_world", { keyframe });
    },
  });
  keyframes.element.classList.add("keyframes");
  keyframes.element.append(icon("keyframe"));
  const setSpeed = (speed: number | "max") =>
    shell.attempt(async () => {
      const { current } = servers;
      if (current !== null) await setParameter(source, current.id, "sim.speed", speed);
    });
  const speed = select({
    label: "Speed relative to real time",
    options: [],
    compact: true,
    change: (value) => {
      if (value !== OTHER) void setSpeed(value === "max" ? value : Number(value)).then(update);
      else askSpeed(app, (wanted) => void setSpeed(wanted).then(update), update);
    },
  });
  speed.element.classList.add("speed");
  shell.tool(
    "time",
    pause.element,
    element("div", { className: "joined" }, ...steps.map((entry) => entry.element)),
    element("div", { className: "joined" }, reset.element, keyframes.element),
    speed.element,
  );
  app.shell.shortcut({ key: " ", text: "Pause or resume", group: GROUP, run: () => pause.element.click() });
  shell.shortcut({ key: "s", text: "Take 1 step", group: GROUP, run: () => steps[0]!.element.click() });
  shell.shortcut({ key: "s", shift: true, text: "Take 10 steps", group: GROUP, run: () => steps[1]!.element.click() });
  shell.shortcut({ key: "Backspace", text: "Reset", group: GROUP, run: () => reset.element.click() });

  let shown = "";
  function update(): void {
    const { info, current } = servers;
    const asked = info?.speed ?? 1;
    const choices = SPEEDS.includes(asked) ? SPEEDS : [asked, ...SPEEDS];
    const names = info?.keyframes ?? [];
    const key = JSON.stringify([choices, names]);
    if (key !== shown) {
      shown = key;
      speed.set([
        ...choices.map((value) => ({ value: `${value}`, text: formatSpeed(value) })),
        { value: OTHER, text: "Other …" },
      ]);
      keyframes.set([
        { value: "", text: "Keyframe" },
        ...names.map((name, index) => ({ value: name || `${index}`, text: name || `Keyframe ${index}` })),
      ]);
      keyframes.element.hidden = names.length === 0;
      keyframes.value = "";
    }
    speed.value = `${asked}`;
    const { paused } = servers;
    pause.set(paused ? { icon: "play", label: "Resume" } : { icon: "pause", label: "Pause" });
    pause.element.classList.toggle("primary", paused);
    const reason = offReason(app, current !== null);
    for (const control of [pause, ...steps, reset, keyframes, speed]) control.disable(reason);
  }
  servers.listen(update);
  let paused = servers.paused;
  source.listen({
    onFrame: () => {
      // Frames come up to 60 times per second; almost all of them change nothing here.
      if (servers.paused !== paused) {
        paused = servers.paused;
        update();
      }
    },
  });
}

/** Returns why the simulation cannot be controlled, or null if it can. */
export function offReason({ source, servers }: Pick<App, "source" | "servers">, known = true): string | null {
  if (source.recorded) return "this is a recording.";
  if (source.readOnly) return "mjplug view was started with --read-only.";
  if (!source.state.connected) return "mjplug view does not answer.";
  if (!known) return "there is no server yet.";
  return servers.current?.connected === false ? "the server is gone." : null;
}

function stepButton(count: number, run: () => void): Button {
  const steps = count === 1 ? "1 step" : `${count} steps`;
  const created = button({
    ...(count === 1 ? { icon: "step" as const, key: "S" } : count === 10 ? { key: "Shift + S" } : {}),
    text: `${count}`,
    label: `Take ${steps}; pauses first`,
    run,
  });
  created.element.setAttribute("aria-label", `Take ${steps}`);
  return created;
}

/** Asks for a speed that is not in the list. */
function askSpeed({ shell, servers }: App, set: (speed: number) => void, cancelled: () => void): void {
  const asked = servers.info?.speed;
  const input = element("input", { type: "number", min: "0.001", max: "1000", step: "any", required: true });
  input.value = `${typeof asked === "number" ? asked : 1}`;
  const form = element("form", { className: "rows", method: "dialog" });
  const hint = "Simulated seconds per second of wall time, from 0.001 to 1000.";
  const apply = element("button", { className: "button primary", type: "submit" }, "Set speed");
  form.append(
    element(
      "label",
      { className: "field" },
      element("span", {}, "Speed"),
      input,
      element("span", { className: "unit" }, "×"),
    ),
    element("p", { className: "hint" }, hint),
    element("div", { className: "row end" }, apply),
  );
  const dialog = shell.dialog("Speed", form);
  dialog.classList.add("small");
  input.select();
  dialog.addEventListener("close", cancelled);
  form.addEventListener("submit", () => set(Number(input.value)));
}
