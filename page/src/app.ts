import type { Dragging } from "./interface/drag.ts";
import type { Selection } from "./interface/selection.ts";
import type { Servers } from "./interface/servers.ts";
import type { Settings } from "./interface/settings.ts";
import type { Shell } from "./interface/shell.ts";
import type { Stage } from "./scene/stage.ts";
import type { Source } from "./wire/source.ts";

/** What the features of the page share. Each feature is a module with `install(app)`. */
export interface App {
  /** Poses, topics and services. */
  readonly source: Source;
  /** The 3D scene. */
  readonly stage: Stage;
  /** Toolbar, panels, shortcuts and notices. */
  readonly shell: Shell;
  /** Which servers are shown, and which one the toolbar controls. */
  readonly servers: Servers;
  /** What the user chose; kept in the browser. */
  readonly settings: Settings;
  /** The selected body. */
  readonly selection: Selection;
  /** The body that the mouse or a finger pulls. */
  readonly drag: Dragging;
}
