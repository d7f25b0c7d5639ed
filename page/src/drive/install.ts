import "./drive.css";
import type { App } from "../app.ts";
import type { InterfaceList } from "../topics/interfaces.ts";
import { DrivePanel } from "./drivepanel.ts";
import { PlaceForm, PushForm } from "./forms.ts";
import { JointPanel } from "./joints.ts";

/** Adds the panels that move robots and bodies. */
export function install(app: App, interfaces: InterfaceList): void {
  const joints = new JointPanel(app, interfaces);
  new DrivePanel(app, interfaces, joints);
  new PushForm(app, interfaces);
  new PlaceForm(app, interfaces);
}
