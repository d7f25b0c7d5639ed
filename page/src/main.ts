import "./style.css";
import "./recording/player.css";
import type { App } from "./app.ts";
import { install as installBodies } from "./interface/bodies.ts";
import { install as installBodyPanel } from "./interface/bodypanel.ts";
import { install as installCamera } from "./interface/cameraview.ts";
import { install as installControl } from "./interface/control.ts";
import { Dragging, install as installDrag } from "./interface/drag.ts";
import { install as installGroups } from "./interface/groups.ts";
import { install as installHelp } from "./interface/help.ts";
import { install as installOverlays } from "./interface/overlays.ts";
import { install as installPointing } from "./interface/pointing.ts";
import { install as installServers } from "./interface/serverpicker.ts";
import { install as installStatus } from "./interface/status.ts";
import { install as installTheme } from "./interface/themebutton.ts";
import { Selection } from "./interface/selection.ts";
import { Servers } from "./interface/servers.ts";
import { Settings } from "./interface/settings.ts";
import { Shell } from "./interface/shell.ts";
import { openRecording } from "./recording/open.ts";
import { install as installPlayer } from "./recording/player.ts";
import { Stage } from "./scene/stage.ts";
import { install as installScene } from "./scene/install.ts";
import { install as installTopics } from "./topics/install.ts";
import { Relay } from "./wire/relay.ts";

/** Each feature adds itself to the page; the order is that of their controls. */
// prettier-ignore
const features: ((app: App) => void)[] = [
  installScene,
  installServers,
  installControl,
  installStatus,
  installCamera,
  installOverlays,
  installGroups,
  installBodies,
  installBodyPanel,
  installPointing,
  installDrag,
  installTopics,
  installPlayer,
  installHelp,
  installTheme,
];
/** Features that need a server, so a recording is shown without them. */
const live = [installControl, installOverlays, installDrag, installTopics];

const socket = new URL("socket", document.baseURI);
socket.protocol = socket.protocol.replace("http", "ws");
const recording = openRecording();
const source = recording ?? new Relay(socket);
const settings = new Settings("mjplug.");
const shell = new Shell(document.body, settings);
const stage = new Stage(shell.stageElement, source);
const servers = new Servers(source, stage, settings);
const shared = { source, shell, stage, servers, settings, selection: new Selection() };
const app: App = { ...shared, drag: new Dragging(shared) };
for (const install of features) if (recording === null || !live.includes(install)) install(app);
