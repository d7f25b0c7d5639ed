import type { App } from "../app.ts";
import type { Fields } from "../wire/protocol.ts";
import type { Subscription } from "../wire/source.ts";
import { element, setText } from "./element.ts";
import { formatAge, formatSpeed, formatTime, fixed } from "./format.ts";
import { AgeMeter, Meter } from "./rates.ts";

/** How often the text is updated [ms]. */
const PERIOD = 200;
/** Frames come at least once per second; without one for this time [s], the picture is called old. */
const STALE = 2.5;

interface Lag {
  /** Wall time that the server did not catch up with [s]. */
  lost: number;
  /** How often it fell behind. */
  behind: number;
  /** Share of wall time spent on steps [%]. */
  load: number;
}

/** Adds the status line: connection, time, speed, state, resets, lag, drawing rate, age of the picture. */
export function install(app: App): void {
  const { shell, source, stage, servers } = app;
  const cells = {
    connection: cell("connection", "Connection"),
    state: cell("state", "Running or paused"),
    time: cell("time", "Simulated time"),
    speed: cell("speed", "Measured speed / asked speed, relative to real time"),
    resets: cell("resets", "Resets since the start of the server"),
    lag: cell("lag", ""),
    spring: element("span", { className: "spring" }),
    drawn: cell("drawn", "Pictures drawn per second"),
    age: cell("age", "Time from the state of the server to the picture"),
  };
  shell.status.append(...Object.values(cells));
  const meter = new Meter();
  const ages = new AgeMeter();
  const drawn = new Meter(2);
  const lag = new LagWatch(app);
  let age = 0;
  let arrived = 0;
  source.listen({
    onFrame: (server) => {
      const { current, frame } = servers;
      if (server !== current?.id || frame === null) return;
      arrived = performance.now() / 1000;
      meter.add(frame.time, frame.wallTime);
      age = ages.age(frame.wallTime, Date.now() / 1000);
    },
  });
  let server = servers.current?.id;
  const update = () => {
    if (server !== servers.current?.id) {
      server = servers.current?.id;
      meter.clear();
      lag.follow(server ?? null);
    }
    const now = performance.now() / 1000;
    const { frame, info, paused } = servers;
    drawn.add(stage.drawn, now);
    const { text, tone } = connection(app);
    setText(cells.connection, text);
    cells.connection.dataset["tone"] = tone;
    for (const part of [cells.state, cells.time, cells.speed, cells.resets, cells.age]) part.hidden = frame === null;
    if (source.recorded) cells.age.hidden = true;
    cells.lag.hidden = frame === null || lag.value === null;
    document.title = title(app);
    if (frame === null) return;
    setText(cells.state, paused ? "Paused" : "Running");
    cells.state.dataset["tone"] = paused ? "warning" : "ok";
    setText(cells.time, formatTime(frame.time));
    setText(cells.speed, `${formatSpeed(paused ? 0 : meter.value)} of ${formatSpeed(info?.speed ?? null)}`);
    const slow = !paused && typeof info?.speed === "number" && (meter.value ?? info.speed) < 0.95 * info.speed;
    cells.speed.dataset["tone"] = slow ? "warning" : "";
    setText(cells.resets, frame.epoch === 1 ? "1 reset" : `${frame.epoch} resets`);
    if (lag.value !== null) showLag(cells.lag, lag.value);
    setText(cells.drawn, `${fixed(drawn.value ?? 0, 0)} fps`);
    const silent = now - arrived;
    const stale = silent > STALE;
    setText(cells.age, stale ? `picture ${formatAge(silent)} old` : formatAge(age));
    cells.age.dataset["tone"] = stale ? "warning" : "";
  };
  servers.listen(update);
  setInterval(update, PERIOD);
}

function cell(name: string, hint: string): HTMLElement {
  return element("span", { className: `cell ${name}`, title: hint });
}

function showLag(target: HTMLElement, { lost, behind, load }: Lag): void {
  setText(target, lost > 0 ? `${formatAge(lost)} lost` : `load ${fixed(load, 0)} %`);
  target.dataset["tone"] = lost > 0 ? "warning" : "";
  target.title =
    `Steps take ${fixed(load, 0)} % of wall time. ` +
    `The server fell behind ${behind} times, and did not catch up with ${fixed(lost, 3)} s of wall time.`;
}

/** Returns the connection in words. */
export function connection({ source, servers }: App): { text: string; tone: "ok" | "warning" | "error" } {
  const { current } = servers;
  if (!source.state.connected) return { text: source.state.text, tone: "error" };
  if (current === null) return { text: "No server found yet; waiting for one", tone: "warning" };
  if (!current.connected) return { text: `${current.name} is gone; waiting for it`, tone: "error" };
  if (source.recorded) return { text: `${current.name} · recording`, tone: "ok" };
  return { text: source.readOnly ? `${current.name} · read-only` : current.name, tone: "ok" };
}

function title({ source, servers }: App): string {
  const { current, paused, frame } = servers;
  if (!source.state.connected) return "not connected · mjplug";
  if (current === null) return "no server · mjplug";
  const state = !current.connected ? "gone" : frame === null ? "loading" : paused ? "paused" : "running";
  return `${current.name} · ${state} · mjplug`;
}

/** Reads the lag of the current server from `/diagnostics`. */
class LagWatch {
  value: Lag | null = null;
  #subscription: Subscription | null = null;
  #opening = false;
  #server: number | null = null;

  constructor(readonly app: App) {
    app.servers.listen(() => void this.#open());
    this.follow(app.servers.current?.id ?? null);
  }

  follow(server: number | null): void {
    this.#server = server;
    this.value = null;
  }

  async #open(): Promise<void> {
    const { source, servers } = this.app;
    if (source.recorded || this.#opening || this.#subscription !== null || servers.current?.connected !== true) return;
    this.#opening = true;
    try {
      this.#subscription = await source.subscribe("/diagnostics", "all", (samples) => {
        for (const { message } of samples) this.#read(message);
      });
    } catch {
      // The topic may be missing or refused; the status line then shows no lag. The next change of a server tries again.
    }
    this.#opening = false;
  }

  #read(message: Fields): void {
    const name = this.app.source.servers.find(({ id }) => id === this.#server)?.name;
    type Status = { name: string; hardware_id: string; values: { key: string; value: string }[] };
    const status = (message["status"] as Status[]).find(
      (entry) => entry.hardware_id === name && entry.name.endsWith(": simulation"),
    );
    if (status === undefined) return;
    const value = (key: string) => Number(status.values.find((entry) => entry.key === key)?.value ?? 0);
    this.value = {
      lost: value("wall time lost (s)"),
      behind: value("times fallen behind"),
      load: value("load (%)"),
    };
  }
}
