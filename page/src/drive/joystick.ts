import { element } from "../interface/element.ts";
import type { Direction } from "./keymap.ts";
import { STOPPED } from "./keymap.ts";

/** A stick for a finger or the mouse: up is forward, left turns to the left. It returns to the middle on release. */
export function joystick(onMove: (direction: Direction) => void): HTMLElement {
  const knob = element("div", { className: "knob" });
  const pad = element("div", { className: "joystick", ariaLabel: "Joystick" }, knob);
  let pointer: number | null = null;
  const move = (event: PointerEvent) => {
    const box = pad.getBoundingClientRect();
    const radius = box.width / 2;
    let x = (event.clientX - box.left - radius) / radius;
    let y = (event.clientY - box.top - radius) / radius;
    const size = Math.hypot(x, y);
    if (size > 1) [x, y] = [x / size, y / size];
    knob.style.translate = `${x * radius * 0.7}px ${y * radius * 0.7}px`;
    onMove({ x: -y || 0, y: 0, yaw: -x || 0 });
  };
  const end = (event: PointerEvent) => {
    if (event.pointerId !== pointer) return;
    pointer = null;
    knob.style.translate = "";
    onMove(STOPPED);
  };
  pad.addEventListener("pointerdown", (event) => {
    if (pointer !== null) return;
    event.preventDefault();
    pointer = event.pointerId;
    pad.setPointerCapture(event.pointerId);
    move(event);
  });
  pad.addEventListener("pointermove", (event) => event.pointerId === pointer && move(event));
  for (const name of ["pointerup", "pointercancel", "lostpointercapture"] as const) pad.addEventListener(name, end);
  return pad;
}
