import { button } from "../interface/controls.ts";
import type { Jog } from "./jog.ts";
import { RATE } from "./teleop.ts";

/** A button that moves a joint while it is held. */
export function jogButton(text: string, label: string, x: number, jog: Jog): HTMLElement {
  const created = button({ text, label, className: "jog", run: () => undefined }).element;
  created.setAttribute("aria-label", label);
  let timer: ReturnType<typeof setInterval> | undefined;
  const end = () => {
    if (timer === undefined) return;
    clearInterval(timer);
    timer = undefined;
    window.removeEventListener("blur", end);
    jog.stop();
  };
  const begin = () => {
    end();
    const step = () => (document.hidden || !created.isConnected ? end() : jog.send({ x, y: 0, yaw: 0 }));
    timer = setInterval(step, 1000 / RATE);
    // Only while it is held, because the window would keep the button for as long as the page is open.
    window.addEventListener("blur", end);
    step();
  };
  created.addEventListener("pointerdown", (event) => {
    created.setPointerCapture(event.pointerId);
    begin();
  });
  for (const name of ["pointerup", "pointercancel", "lostpointercapture", "blur"]) created.addEventListener(name, end);
  created.addEventListener("keydown", (event) => {
    if (event.key !== "Enter" && event.key !== " ") return;
    event.preventDefault();
    if (!event.repeat) begin();
  });
  created.addEventListener("keyup", end);
  return created;
}
