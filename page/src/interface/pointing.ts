import { Quaternion, Raycaster, Vector2, Vector3 } from "three";
import type { App } from "../app.ts";
import { LongPress } from "./gestures.ts";

/** Returns a ray from the camera through a point of the window [px]. */
export function rayThrough({ stage }: Pick<App, "stage">, x: number, y: number): Raycaster {
  const { left, top, width, height } = stage.canvas.getBoundingClientRect();
  const caster = new Raycaster();
  caster.setFromCamera(new Vector2((2 * (x - left)) / width - 1, 1 - (2 * (y - top)) / height), stage.camera);
  return caster;
}

/** Returns the direction in which the camera looks, and its orientation. */
export function viewOf({ stage }: Pick<App, "stage">): { direction: Vector3; orientation: Quaternion } {
  return {
    direction: stage.camera.getWorldDirection(new Vector3()),
    orientation: stage.camera.getWorldQuaternion(new Quaternion()),
  };
}

/** Adds selecting: double click, long press, Escape. */
export function install(app: App): void {
  const { shell, stage, selection } = app;
  const { canvas } = stage;
  const press = new LongPress();
  const select = (x: number, y: number) => {
    const picked = stage.pick(x, y);
    if (picked === null) {
      selection.select(null);
      return;
    }
    const { world, body, point } = picked;
    const local = world.bodies[body]!.worldToLocal(point.clone());
    selection.select({ world, body, local: [local.x, local.y, local.z] });
    if (!shell.phone) shell.panels.reveal("Selection");
  };
  canvas.addEventListener("dblclick", (event) => select(event.clientX, event.clientY));
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("pointerdown", (event) => {
    if (event.pointerType !== "mouse" && event.isPrimary) {
      press.start(event.clientX, event.clientY, () => {
        select(event.clientX, event.clientY);
        navigator.vibrate?.(15);
      });
    } else {
      press.cancel();
    }
  });
  canvas.addEventListener("pointermove", (event) => event.isPrimary && press.move(event.clientX, event.clientY));
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => press.cancel());
  stage.onWorld((world) => {
    const { current } = selection;
    if (current === null || current.world.server !== world.server) return;
    // A new model: the body with the same name stays selected.
    const name = current.world.pack.header.bodies[current.body]!.name;
    const body = world.pack.header.bodies.findIndex((entry) => entry.name === name);
    selection.select(name !== "" && body > 0 ? { world, body } : null);
  });
  stage.onRemove((world) => selection.current?.world === world && selection.select(null));
  shell.shortcut({
    key: "Escape",
    text: "Let go of the body, or deselect it",
    group: "Selection",
    run: () => selection.select(null),
  });
  const group = "Mouse and touch";
  shell.gesture({ keys: "Double click", text: "Select a body (touch: press long)", group });
  shell.gesture({ keys: "Left drag", text: "Orbit (touch: one finger)", group });
  shell.gesture({ keys: "Right drag", text: "Move the camera (touch: two fingers)", group });
  shell.gesture({ keys: "Wheel", text: "Zoom (touch: two fingers)", group });
}
