import type { App } from "../app.ts";
import { button, select } from "../interface/controls.ts";
import { element, setText } from "../interface/element.ts";
import { formatSpeed } from "../interface/format.ts";
import { Recording } from "./recording.ts";

const RATES = [0.1, 0.25, 0.5, 1, 2, 4, 8];
const GROUP = "Recording";
/** Steps of the slider. */
const STEPS = 10000;

/** Adds the player below the scene, if the page is a recording. */
export function install({ source, stage, shell }: App): void {
  if (!(source instanceof Recording)) return;
  const play = button({ icon: "pause", label: "Pause", key: "Space", className: "strong", run: () => toggle() });
  const slider = element("input", { type: "range", min: "0", max: `${STEPS}`, step: "1", value: "0" });
  slider.setAttribute("aria-label", "Position in the recording");
  const clock = element("span", { className: "clock" });
  const rate = select({
    label: "Speed of the player",
    options: RATES.map((value) => ({ value: `${value}`, text: formatSpeed(value) })),
    value: "1",
    compact: true,
    change: (value) => {
      source.rate = Number(value);
    },
  });
  const bar = element("div", { className: "player" }, play.element, slider, clock, rate.element);
  bar.setAttribute("role", "group");
  bar.setAttribute("aria-label", "Player");
  shell.stageElement.append(bar);

  const update = () => {
    play.set(source.playing ? { icon: "pause", label: "Pause" } : { icon: "play", label: "Play" });
    const share = source.duration > 0 ? source.position / source.duration : 0;
    slider.value = `${Math.round(STEPS * share)}`;
    const text = `${formatClock(source.position)} / ${formatClock(source.duration)}`;
    slider.setAttribute("aria-valuetext", text);
    setText(clock, text);
  };
  const toggle = () => {
    if (!source.playing && source.position >= source.duration) void source.seek(0);
    source.playing = !source.playing && source.duration > 0;
    update();
  };
  const seek = (position: number) => {
    void source.seek(position);
    update();
  };
  const step = (direction: -1 | 1) => void source.step(direction).then(update);

  // While the user moves the slider, the recording stands still.
  let resume = false;
  slider.addEventListener("pointerdown", () => {
    resume = source.playing;
    source.playing = false;
  });
  for (const end of ["pointerup", "pointercancel"]) {
    slider.addEventListener(end, () => {
      source.playing ||= resume;
      resume = false;
      update();
    });
  }
  slider.addEventListener("input", () => seek((source.duration * Number(slider.value)) / STEPS));
  shell.shortcut({ key: " ", text: "Play or pause", group: GROUP, run: toggle });
  shell.shortcut({ key: "ArrowLeft", text: "Back by one frame", group: GROUP, run: () => step(-1) });
  shell.shortcut({ key: "ArrowRight", text: "Forward by one frame", group: GROUP, run: () => step(1) });
  stage.onWorld(() => source.refresh());
  stage.beforeDraw((seconds) => {
    if (!source.playing) return;
    void source.advance(seconds);
    update();
  });
  update();
}

/** Returns a position, such as "1:02.5". */
export function formatClock(seconds: number): string {
  const tenths = Math.round(10 * seconds);
  const rest = (tenths % 600) / 10;
  return `${Math.floor(tenths / 600)}:${rest.toFixed(1).padStart(4, "0")}`;
}
