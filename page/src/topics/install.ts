import "uplot/dist/uPlot.min.css";
import "./topics.css";
import type { App } from "../app.ts";
import { install as installDrive } from "../drive/install.ts";
import { FrameFinder } from "./frames.ts";
import { ImageWindows } from "./images.ts";
import { InterfaceList } from "./interfaces.ts";
import { TopicPanel } from "./panel.ts";
import { Plots } from "./plots/panel.ts";

/** Adds topics in the scene, images of cameras, plots, and the controls that drive a robot. */
export function install(app: App): void {
  // A recording contains poses only.
  if (app.source.recorded) return;
  const interfaces = new InterfaceList(app.source);
  new TopicPanel(app, interfaces, new FrameFinder(app, interfaces), new ImageWindows(app));
  new Plots(app, interfaces);
  installDrive(app, interfaces);
}
