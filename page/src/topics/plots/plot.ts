import uPlot from "uplot";
import type { App } from "../../app.ts";
import { button, select, type Button } from "../../interface/controls.ts";
import { element, setText } from "../../interface/element.ts";
import { count, fixed } from "../../interface/format.ts";
import type { Floating } from "../../interface/floating.ts";
import { paletteColour } from "../displays/display.ts";
import type { Channel, Feed } from "./feed.ts";
import { merge, toCsv } from "./series.ts";
import { unitOf } from "./units.ts";

/** What the browser keeps of a plot. */
export interface PlotState {
  readonly series: readonly { readonly topic: string; readonly path: string }[];
  /** Length of the time axis [s]. */
  readonly span: number;
}

const SPANS = [5, 10, 30, 60, 300];
/** Colours in both themes; the palette of the scene has some that are too light for lines on white. */
const LINES = { dark: 0, light: 1 };
const ON_LIGHT = ["#b85c00", "#0072b2", "#00795a", "#b3261e", "#a64d79", "#3d4aa8", "#6b6500"];

/** A plot in a window above the scene. */
export class Plot {
  readonly #window: Floating;
  readonly #chart = element("div", { className: "plot-chart" });
  readonly #note = element("p", { className: "plot-note" });
  readonly #pause: Button;
  readonly #channels: Channel[] = [];
  #plot: uPlot | null = null;
  #span: number;
  #paused = false;
  /** Whether the user has zoomed; the time axis then stands still. */
  #zoomed = false;
  #shown = "";

  /**
   * @param onChange - Called when the series or the time axis have changed.
   * @param onClose - Called when the window is closed.
   * @param onAdd - Called when the user wants another series.
   */
  constructor(
    readonly app: App,
    readonly feed: Feed,
    state: PlotState,
    readonly onChange: () => void,
    onClose: () => void,
    onAdd: () => void,
  ) {
    this.#span = state.span;
    const { shell } = app;
    const close = () => {
      for (const channel of this.#channels) feed.close(channel);
      this.#plot?.destroy();
      this.#plot = null;
      onClose();
    };
    this.#window = shell.window("Plot", { width: 480, height: 280, onClose: close });
    const span = select({
      label: "Time axis",
      compact: true,
      options: SPANS.map((seconds) => ({ value: `${seconds}`, text: `${seconds} s` })),
      value: `${state.span}`,
      change: (value) => {
        this.#span = Number(value);
        this.#zoomed = false;
        this.#shown = "";
        onChange();
      },
    });
    this.#pause = button({ icon: "pause", label: "Pause the plot", className: "bare", run: () => this.#setPaused() });
    const add = button({ icon: "add", label: "Add a field", className: "bare", run: onAdd });
    const save = button({ icon: "download", label: "Save as CSV", className: "bare", run: () => this.#save() });
    this.#window.bar.append(span.element, add.element, this.#pause.element, save.element);
    this.#window.content.classList.add("plot-content");
    this.#window.content.append(this.#chart, this.#note);
    new ResizeObserver(() => this.#resize()).observe(this.#chart);
    shell.themes.listen(() => this.#rebuild());
    for (const { topic, path } of state.series) this.#channels.push(feed.open(topic, path));
    this.#rebuild();
  }

  get state(): PlotState {
    return { series: this.#channels.map(({ topic, path }) => ({ topic, path })), span: this.#span };
  }

  add(topic: string, path: string): void {
    if (this.#channels.some((channel) => channel.topic === topic && channel.path === path)) return;
    this.#channels.push(this.feed.open(topic, path));
    this.#rebuild();
    this.onChange();
  }

  /** Returns the samples, as CSV. */
  get csv(): string {
    return toCsv(this.#channels.map(labelOf), merge(this.#channels.map(({ series }) => series)));
  }

  /** Draws what is new; called several times a second. */
  draw(): void {
    const problem = this.#channels.map(({ topic }) => this.feed.problems.get(topic) ?? "").find(Boolean) ?? "";
    const lost = this.#channels.reduce((sum, { series }) => sum + series.lost, 0);
    setText(this.#note, problem || (lost > 0 ? `${count(lost, "sample")} lost, shown as gaps` : ""));
    if (this.#plot === null || this.#paused || this.#zoomed) return;
    const newest = Math.max(...this.#channels.map(({ series }) => series.times.at(-1) ?? -Infinity));
    const shown = `${newest} ${this.#channels.map(({ series }) => series.length).join(" ")} ${this.#span}`;
    if (shown === this.#shown || !Number.isFinite(newest)) return;
    this.#shown = shown;
    const { times, values } = merge(
      this.#channels.map(({ series }) => series),
      newest - this.#span,
    );
    this.#plot.setData([times, ...values] as uPlot.AlignedData, false);
    this.#plot.batch(() => {
      this.#plot?.setScale("x", { min: newest - this.#span, max: newest });
    });
  }

  #remove(index: number): void {
    const [channel] = this.#channels.splice(index, 1);
    if (channel !== undefined) this.feed.close(channel);
    if (this.#channels.length === 0) this.#window.close();
    else this.#rebuild();
    this.onChange();
  }

  #setPaused(): void {
    this.#paused = !this.#paused;
    this.#zoomed = false;
    this.#shown = "";
    this.#pause.press(this.#paused);
    this.#pause.set(
      this.#paused ? { icon: "play", label: "Continue the plot" } : { icon: "pause", label: "Pause the plot" },
    );
  }

  #save(): void {
    const url = URL.createObjectURL(new Blob([this.csv], { type: "text/csv" }));
    element("a", { href: url, download: "plot.csv" }).click();
    setTimeout(() => URL.revokeObjectURL(url), 1000);
  }

  #resize(): void {
    const { clientWidth: width, clientHeight: height } = this.#chart;
    const legend = this.#chart.querySelector<HTMLElement>(".u-legend")?.offsetHeight ?? 0;
    if (width > 0) this.#plot?.setSize({ width, height: Math.max(80, height - legend) });
  }

  /** Creates the chart again, because the series or the colours have changed. */
  #rebuild(): void {
    if (!this.#chart.isConnected) return;
    this.#plot?.destroy();
    this.#shown = "";
    const { themes } = this.app.shell;
    const [text, line] = [themes.token("--muted"), themes.token("--line")];
    const grid = { stroke: line, width: 1 };
    const axis = { stroke: text, grid, ticks: { ...grid, size: 4 }, font: "11px system-ui" };
    const units = new Set(this.#channels.map((channel) => this.#unit(channel)));
    const [unit = ""] = units.size === 1 ? [...units] : [];
    const options: uPlot.Options = {
      width: Math.max(200, this.#chart.clientWidth),
      height: Math.max(100, this.#chart.clientHeight - 30),
      scales: { x: { time: false } },
      axes: [
        { ...axis, size: 30, values: (_, splits) => splits.map((value) => `${value} s`) },
        { ...axis, size: 58 },
      ],
      series: [
        { label: "t", value: (_, value) => format(value, "s") },
        ...this.#channels.map((c, i) => this.#series(c, i)),
      ],
      cursor: { drag: { x: true, y: false }, focus: { prox: 24 } },
      hooks: { setSelect: [(plot) => (this.#zoomed ||= plot.select.width > 0)] },
    };
    const [, vertical] = options.axes!;
    if (unit !== "") Object.assign(vertical!, { label: unit, labelSize: 18, labelFont: "11px system-ui" });
    this.#chart.replaceChildren();
    const { times, values } = merge(this.#channels.map(({ series }) => series));
    this.#plot = new uPlot(options, [times, ...values] as uPlot.AlignedData, this.#chart);
    this.#plot.over.addEventListener("dblclick", () => {
      this.#zoomed = false;
      this.#shown = "";
    });
    this.#legend();
    this.#window.title = this.#channels.length === 1 ? labelOf(this.#channels[0]!) : "Plot";
    this.#resize();
  }

  #series(channel: Channel, index: number): uPlot.Series {
    const light = this.app.shell.themes.dark ? LINES.dark : LINES.light;
    const colour = light === LINES.light ? ON_LIGHT[index % ON_LIGHT.length]! : paletteColour(index);
    return {
      label: this.#channels.length === 1 ? channel.path : labelOf(channel),
      stroke: colour,
      width: 1.5,
      points: { size: 4 },
      value: (_, value) => format(value, this.#unit(channel)),
    };
  }

  /** Adds a button to each entry of the legend that removes the series. */
  #legend(): void {
    const rows = [...this.#chart.querySelectorAll<HTMLElement>(".u-legend .u-series")].slice(1);
    rows.forEach((row, index) => {
      const channel = this.#channels[index];
      if (channel === undefined) return;
      const run = () => this.#remove(index);
      const label = `Remove ${labelOf(channel)}`;
      row.append(button({ icon: "close", label, className: "bare plot-remove", run }).element);
    });
  }

  #unit({ topic, path }: Channel): string {
    return unitOf(this.feed.types.get(topic) ?? "", path);
  }
}

function labelOf({ topic, path }: Channel): string {
  return `${topic} ${path}`;
}

function format(value: number | null | undefined, unit: string): string {
  if (value === null || value === undefined) return "–";
  const size = Math.abs(value);
  const text = size !== 0 && (size < 1e-3 || size >= 1e6) ? value.toExponential(3) : fixed(value, size < 10 ? 4 : 2);
  return unit === "" ? text : `${text} ${unit}`;
}
