import type { App } from "../app.ts";
import { OVERLAY_KINDS, type OverlayKind } from "../wire/protocol.ts";
import { toggle } from "./controls.ts";
import { element } from "./element.ts";

const TEXTS: Readonly<Record<OverlayKind, string>> = {
  contacts: "Contacts",
  contact_forces: "Contact forces",
  tendons: "Tendons",
  joints: "Joints",
  actuators: "Actuators",
  com: "Mass centres",
  inertia: "Inertia",
  rangefinders: "Rangefinders",
  frames: "Body frames",
  perturbation: "All drags",
};

const HINTS: Partial<Readonly<Record<OverlayKind, string>>> = {
  contact_forces: "Arrows, scaled as the model says",
  com: "Of each tree of bodies",
  inertia: "Boxes with the same inertia as the bodies",
  perturbation: "The springs of all viewers that drag bodies",
};

/** Adds the overlays that the server draws, each requested only while it is on. */
export function install(app: App): void {
  const { shell, source, stage, servers } = app;
  const wanted = new Set<OverlayKind>();
  /** The overlays that were requested, as "server kind". */
  const requested = new Map<string, { server: number; kind: OverlayKind }>();
  const content = shell.panel("Overlays", { icon: "layers", order: 20, open: !shell.phone });
  const toggles = OVERLAY_KINDS.map((kind) =>
    toggle({
      text: TEXTS[kind],
      hint: HINTS[kind] ?? "",
      change: (on) => {
        on ? wanted.add(kind) : wanted.delete(kind);
        update();
      },
    }),
  );
  content.append(element("div", { className: "columns" }, ...toggles.map((entry) => entry.element)));

  function update(): void {
    const shown = source.servers.filter(({ id }) => servers.isShown(id));
    for (const { id } of shown) {
      for (const kind of wanted) {
        if (requested.has(`${id} ${kind}`)) continue;
        requested.set(`${id} ${kind}`, { server: id, kind });
        source.overlay(id, kind, true);
      }
    }
    for (const [key, { server, kind }] of requested) {
      if (wanted.has(kind) && servers.isShown(server)) continue;
      requested.delete(key);
      source.overlay(server, kind, false);
      stage.worlds.get(server)?.setOverlay(kind, null);
      stage.invalidate();
    }
  }
  source.listen({
    // A shape that was under way when its overlay was switched off.
    onOverlay: (server, kind) => {
      if (!requested.has(`${server} ${kind}`)) stage.worlds.get(server)?.setOverlay(kind, null);
    },
  });
  servers.listen(update);
}
