import type { App } from "../../app.ts";
import { button } from "../../interface/controls.ts";
import { element } from "../../interface/element.ts";
import type { InterfaceList } from "../interfaces.ts";
import { FieldBrowser } from "./browser.ts";
import { entryOf, Feed } from "./feed.ts";
import { Plot, type PlotState } from "./plot.ts";

/** Time between two drawings of the plots [ms]. */
const PERIOD = 100;
const SPAN = 10;

/** The plots of the page; they survive a reload. */
export class Plots {
  readonly plots: Plot[] = [];
  readonly #feed: Feed;

  constructor(
    readonly app: App,
    readonly interfaces: InterfaceList,
  ) {
    this.#feed = new Feed(app, (topic) => entryOf(interfaces.topics, topic)?.server ?? 0);
    const content = app.shell.panel("Plots", {
      icon: "plot",
      order: 60,
      onToggle: (open) => interfaces.use(this, open),
    });
    const hint = element("p", { className: "hint" }, "Plots show numbers of any topic against simulated time.");
    const add = button({ icon: "add", text: "Add a plot", run: () => this.#browse(null) });
    content.append(element("div", { className: "rows" }, hint, element("div", { className: "row" }, add.element)));
    app.shell.shortcut({ key: "p", text: "Add a plot", group: "Topics", run: () => this.#browse(null) });
    if (app.source.recorded) add.disable("A recording contains no topics.");
    setInterval(() => {
      if (document.hidden) return;
      for (const plot of this.plots) plot.draw();
    }, PERIOD);
    this.#restoreWhenConnected();
  }

  /** Asks for a field and adds it to a plot; null makes a new one. */
  #browse(plot: Plot | null): void {
    let target = plot;
    void this.interfaces.refresh().then(() => {
      new FieldBrowser(this.app, this.interfaces.topics, (topic, path) => {
        if (target === null || !this.plots.includes(target))
          target = this.#open({ series: [{ topic, path }], span: SPAN });
        else target.add(topic, path);
        this.#keep();
      });
    });
  }

  #open(state: PlotState): Plot {
    const plot: Plot = new Plot(
      this.app,
      this.#feed,
      state,
      () => this.#keep(),
      () => {
        this.plots.splice(this.plots.indexOf(plot), 1);
        this.#keep();
      },
      () => this.#browse(plot),
    );
    this.plots.push(plot);
    return plot;
  }

  #keep(): void {
    this.app.settings.set("plots", JSON.stringify(this.plots.map((plot) => plot.state)));
  }

  #restoreWhenConnected(): void {
    let restored = false;
    const restore = () => {
      if (restored || this.interfaces.topics.length === 0) return;
      restored = true;
      for (const state of readStates(this.app.settings.get("plots", "[]"))) this.#open(state);
    };
    this.interfaces.listen(restore);
    restore();
  }
}

/** Returns the plots that the browser has kept; what cannot be read is left out. */
export function readStates(text: string): PlotState[] {
  let parsed: unknown;
  try {
    parsed = JSON.parse(text);
  } catch {
    return [];
  }
  if (!Array.isArray(parsed)) return [];
  const states: PlotState[] = [];
  for (const entry of parsed as Partial<PlotState>[]) {
    const series = (Array.isArray(entry?.series) ? entry.series : []).filter(
      (one: unknown): one is PlotState["series"][number] =>
        typeof (one as PlotState["series"][number])?.topic === "string" &&
        typeof (one as PlotState["series"][number])?.path === "string",
    );
    if (series.length > 0) states.push({ series, span: typeof entry.span === "number" ? entry.span : SPAN });
  }
  return states;
}
