import "./style.css";
import type { App } from "./app.ts";
import { Selection } from "./interface/selection.ts";
import { Settings } from "./interface/settings.ts";
import { Shell } from "./interface/shell.ts";
import { Stage } from "./scene/stage.ts";
import { Relay } from "./wire/relay.ts";

/** Each feature adds itself to the page. */
const features: ((app: App) => void)[] = [];

const socket = new URL("socket", document.baseURI);
socket.protocol = socket.protocol.replace("http", "ws");
const source = new Relay(socket);
const shell = new Shell(document.body);
const app: App = {
  source,
  shell,
  stage: new Stage(shell.stageElement, source),
  settings: new Settings("mjplug."),
  selection: new Selection(),
};
for (const install of features) install(app);
source.listen({
  onServers: (servers) => {
    const first = servers.find(({ connected }) => connected);
    if (first !== undefined) source.watch(first.id, true);
  },
});
