import { Quaternion, Vector3 } from "three";
import type { App } from "../app.ts";
import type { World } from "../scene/world.ts";
import type { Drag } from "../wire/source.ts";
import { offReason } from "./control.ts";
import { button } from "./controls.ts";
import { type DragPlane, PullTarget, turned } from "./draggeometry.ts";
import { DragLine } from "./dragline.ts";
import { element, setText } from "./element.ts";
import { formatQuantity } from "./format.ts";
import { type DragKind, dragKind, type DragMode } from "./gestures.ts";
import { rayThrough, viewOf } from "./pointing.ts";
import { bodyName } from "./selection.ts";

/** The server lets go after 0.5 s without a message; this is ten times as often [ms]. */
const REPEAT = 50;

/** A body that the mouse or a finger holds. */
interface Hold {
  readonly pointer: number;
  readonly kind: DragKind;
  readonly world: World;
  readonly body: number;
  /** The grabbed point in the body's frame [m]. */
  readonly local: Vector3;
  readonly pull: PullTarget;
  readonly epoch: number;
  /** Whether the mouse moved the camera before. */
  readonly controls: boolean;
  readonly start: { readonly x: number; readonly y: number; readonly orientation: Quaternion };
  plane: DragPlane;
  rotation: Quaternion;
}

/** Pulls and turns bodies with the mouse, a pen or a finger. */
export class Dragging {
  mode: DragMode = "off";
  #hold: Hold | null = null;
  #timer: ReturnType<typeof setInterval> | null = null;
  readonly #line = new DragLine();
  readonly #label = element("div", { className: "draglabel", hidden: true });

  constructor(readonly app: Omit<App, "drag">) {
    const { stage, source, shell } = app;
    stage.scene.add(this.#line.root);
    shell.stageElement.append(this.#label);
    // Before the controls of the camera, which listen on the canvas.
    const early = { capture: true };
    shell.stageElement.addEventListener("pointerdown", (event) => this.#down(event), early);
    window.addEventListener("pointermove", (event) => this.#move(event), early);
    for (const name of ["pointerup", "pointercancel"] as const) {
      window.addEventListener(name, (event) => event.pointerId === this.#hold?.pointer && this.end(), early);
    }
    // Not a shortcut, because Ctrl may still be pressed.
    const escape = (event: KeyboardEvent) => {
      if (event.key !== "Escape" || !this.end()) return;
      event.preventDefault();
      event.stopPropagation();
    };
    window.addEventListener("keydown", escape, early);
    window.addEventListener("blur", () => this.end());
    document.addEventListener("visibilitychange", () => document.hidden && this.end());
    for (const name of ["keydown", "keyup"] as const) {
      window.addEventListener(name, (event) => event.key === "Shift" && this.#setPlane(name === "keydown"));
    }
    source.listen({
      onState: ({ connected }) => !connected && this.end(),
      onFrame: () => this.#hold !== null && this.#hold.world.frame?.epoch !== this.#hold.epoch && this.end(),
    });
    stage.onWorld((world) => this.#hold?.world.server === world.server && this.end());
    stage.onRemove((world) => this.#hold?.world === world && this.end());
    stage.beforeDraw(() => this.#draw());
  }

  /** Whether a body is held. */
  get active(): boolean {
    return this.#hold !== null;
  }

  /** Lets go; returns whether a body was held. */
  end(): boolean {
    const hold = this.#hold;
    if (hold === null) return false;
    this.#hold = null;
    if (this.#timer !== null) clearInterval(this.#timer);
    this.app.source.drag(hold.world.server, null);
    this.#line.hide();
    this.#label.hidden = true;
    this.app.stage.controls.enabled = hold.controls;
    this.app.stage.canvas.classList.remove("dragging");
    this.app.stage.invalidate();
    return true;
  }

  #down(event: PointerEvent): void {
    const { stage, selection } = this.app;
    if (event.target !== stage.canvas) return;
    if (this.#hold !== null) {
      // A second finger does nothing while the first one drags.
      event.stopPropagation();
      return;
    }
    const modified = event.ctrlKey || event.metaKey;
    if (!modified && this.mode === "off") return;
    const picked = stage.pick(event.clientX, event.clientY);
    const onBody = picked !== null && canMove(picked.world, picked.body);
    const kind = dragKind(event, this.mode, onBody);
    if (kind === null) return;
    event.stopPropagation();
    const { current } = selection;
    const grabbed =
      picked !== null && onBody && (current === null || !modified || picked.body === current.body)
        ? { world: picked.world, body: picked.body, point: picked.point }
        : current === null
          ? null
          : { ...current, point: current.world.bodyPoint(current.body, current.local) };
    if (grabbed === null) {
      this.app.shell.notice("Press Ctrl on a body that can move, or select one first.");
      return;
    }
    this.#grab(event, kind, grabbed);
  }

  #grab(event: PointerEvent, kind: DragKind, grabbed: { world: World; body: number; point: Vector3 }): void {
    const { stage, shell, selection } = this.app;
    const { world, body, point } = grabbed;
    const reason = offReason(this.app);
    if (reason !== null) return shell.notice(`Bodies cannot be dragged: ${reason}`);
    if (!canMove(world, body))
      return shell.notice(`${bodyName(world, body)} is fixed to the world and cannot be dragged.`);
    const group = world.bodies[body]!;
    const local = group.worldToLocal(point.clone());
    const { current } = selection;
    if (current?.world !== world || current.body !== body) {
      selection.select({ world, body, local: [local.x, local.y, local.z] });
    }
    const plane = event.shiftKey ? "horizontal" : "camera";
    const hold: Hold = {
      pointer: event.pointerId,
      kind,
      world,
      body,
      local,
      plane,
      pull: new PullTarget(point),
      epoch: world.frame?.epoch ?? 0,
      controls: stage.controls.enabled,
      start: { x: event.clientX, y: event.clientY, orientation: group.getWorldQuaternion(new Quaternion()) },
      rotation: group.getWorldQuaternion(new Quaternion()),
    };
    hold.pull.start(plane, rayThrough(this.app, event.clientX, event.clientY).ray, viewOf(this.app).direction);
    this.#hold = hold;
    this.#last = event;
    stage.controls.enabled = false;
    stage.canvas.setPointerCapture(event.pointerId);
    stage.canvas.classList.add("dragging");
    this.#send();
    this.#timer = setInterval(() => this.#send(), REPEAT);
    stage.invalidate();
  }

  #last: { readonly clientX: number; readonly clientY: number } = { clientX: 0, clientY: 0 };

  #move(event: PointerEvent): void {
    const hold = this.#hold;
    if (hold === null || event.pointerId !== hold.pointer) return;
    event.stopPropagation();
    this.#last = event;
    if (hold.kind === "pull") {
      hold.pull.move(rayThrough(this.app, event.clientX, event.clientY).ray);
    } else {
      const height = this.app.stage.canvas.clientHeight;
      const [right, down] = [(event.clientX - hold.start.x) / height, (event.clientY - hold.start.y) / height];
      hold.rotation = turned(hold.start.orientation, viewOf(this.app).orientation, right, down);
    }
    this.app.stage.invalidate();
  }

  /** Changes between the plane that faces the camera and the horizontal one, while the body is held. */
  #setPlane(horizontal: boolean): void {
    const hold = this.#hold;
    const plane = horizontal ? "horizontal" : "camera";
    if (hold === null || hold.plane === plane) return;
    hold.plane = plane;
    const { ray } = rayThrough(this.app, this.#last.clientX, this.#last.clientY);
    hold.pull.start(plane, ray, viewOf(this.app).direction);
  }

  #send(): void {
    const hold = this.#hold;
    if (hold === null) return;
    const { kind, world, body, local, pull, rotation } = hold;
    const inverse = world.root.getWorldQuaternion(new Quaternion()).invert();
    const target = world.root.worldToLocal(pull.target.clone());
    const { w, x, y, z } = inverse.multiply(rotation);
    const drag: Drag = {
      body,
      local: [local.x, local.y, local.z],
      ...(kind === "pull" ? { target: [target.x, target.y, target.z] } : { rotate: [w, x, y, z] }),
    };
    this.app.source.drag(world.server, drag);
  }

  #draw(): void {
    const hold = this.#hold;
    if (hold === null) return;
    const { stage } = this.app;
    const from = hold.world.bodyPoint(hold.body, [hold.local.x, hold.local.y, hold.local.z]);
    const to = hold.kind === "pull" ? hold.pull.target : from;
    this.#line.show(from, to, stage.camera);
    const place = stage.projectPoint(to);
    const { left, top } = stage.canvas.getBoundingClientRect();
    this.#label.hidden = place === null;
    this.#label.style.left = `${(place?.x ?? 0) - left}px`;
    this.#label.style.top = `${(place?.y ?? 0) - top}px`;
    const now = hold.world.bodies[hold.body]!.getWorldQuaternion(new Quaternion());
    const degrees = (now.angleTo(hold.rotation) * 180) / Math.PI;
    setText(this.#label, hold.kind === "pull" ? formatQuantity(from.distanceTo(to), "m") : `${degrees.toFixed(0)}°`);
    stage.invalidate();
  }
}

/** Whether a body can be dragged; one that is fixed to the world cannot. */
function canMove(world: World, body: number): boolean {
  return world.pack.header.moving.includes(body);
}

/** Adds the modes in which a plain drag, or one finger, pulls or turns bodies. */
export function install(app: App): void {
  const { shell, drag, servers } = app;
  const choose = (mode: DragMode) => {
    drag.mode = drag.mode === mode ? "off" : mode;
    for (const [name, { press }] of Object.entries(buttons)) press(name === drag.mode);
    app.stage.canvas.classList.toggle("grabbing", drag.mode !== "off");
  };
  const buttons = {
    pull: button({
      icon: "grab",
      label: "Pull bodies with a drag or one finger",
      key: "D",
      run: () => choose("pull"),
    }),
    turn: button({ icon: "turn", label: "Turn bodies with a drag or one finger", key: "T", run: () => choose("turn") }),
  };
  choose("off");
  const group = "Dragging";
  shell.tool("view", element("div", { className: "joined" }, buttons.pull.element, buttons.turn.element));
  shell.shortcut({
    key: "d",
    text: "Pull with a plain drag or one finger",
    group,
    run: () => buttons.pull.element.click(),
  });
  shell.shortcut({
    key: "t",
    text: "Turn with a plain drag or one finger",
    group,
    run: () => buttons.turn.element.click(),
  });
  shell.gesture({ keys: "Ctrl + right drag", text: "Pull the selected body", group });
  shell.gesture({ keys: "Shift", text: "While pulling: stay at this height", group });
  shell.gesture({ keys: "Ctrl + left drag", text: "Turn the selected body", group });
  shell.gesture({ keys: "⌘ + drag", text: "Pull, on a Mac", group });
  servers.listen(() => {
    const reason = offReason(app);
    for (const { disable } of Object.values(buttons)) disable(reason);
    if (reason !== null && drag.mode !== "off") choose("off");
  });
}
