import type { App } from "../app.ts";
import type { Statistics } from "./statistics.ts";

/** What tests and scripts may ask the page: `window.mjplug`. */
export interface Probe {
  stats(): Statistics;
  /** Returns the place of a body's origin on the page [px]; null if there is no such body in the picture. */
  point(body: string | number, server?: number): { x: number; y: number } | null;
  readonly app: App;
}

declare global {
  interface Window {
    mjplug?: Probe;
  }
}

/** Offers `window.mjplug`, and follows the theme of the page. */
export function install(app: App): void {
  const { stage } = app;
  window.mjplug = {
    app,
    stats: () => stage.statistics(),
    point: (body, server) => {
      const world = server === undefined ? stage.worlds.values().next().value : stage.worlds.get(server);
      if (world === undefined) return null;
      const id = typeof body === "number" ? body : world.pack.header.bodies.findIndex(({ name }) => name === body);
      return id in world.bodies ? stage.project(world, id) : null;
    },
  };
  const { themes } = app.shell;
  const colour = () => stage.background(themes.dark ? "dark" : "light");
  themes.listen(colour);
  colour();
}
