import { button } from "./controls.ts";
import { element, uniqueId } from "./element.ts";

export interface FloatingOptions {
  /** Size of the content [px]. Default: 320 × 240. */
  readonly width?: number;
  readonly height?: number;
  /** Called once, when the user or `close` closes the window. */
  onClose?(): void;
}

/** A window above the scene, for example with the image of a camera or with a plot. */
export interface Floating {
  readonly content: HTMLElement;
  /** The title bar, for buttons of the window. */
  readonly bar: HTMLElement;
  title: string;
  close(): void;
}

const GAP = 12;
const CASCADE = 28;

/** The windows above the scene. The user moves and resizes them; they stay inside the scene. */
export class FloatingWindows {
  readonly element = element("div", { className: "windows" });
  #opened = 0;

  open(title: string, options: FloatingOptions): Floating {
    const heading = element("h2", { id: uniqueId("window") }, title);
    const content = element("div", { className: "content" });
    const bar = element("div", { className: "bar" });
    const close = () => {
      frame.remove();
      options.onClose?.();
    };
    const closing = button({ icon: "close", label: `Close ${title}`, className: "bare", run: close });
    const header = element("header", {}, heading, bar, closing.element);
    const frame = element("section", { className: "window", tabIndex: -1 }, header, content);
    frame.setAttribute("aria-labelledby", heading.id);
    frame.style.width = `${options.width ?? 320}px`;
    content.style.height = `${options.height ?? 240}px`;
    frame.addEventListener("keydown", (event) => {
      if (event.key !== "Escape" || event.defaultPrevented) return;
      event.preventDefault();
      close();
    });
    this.#place(frame);
    this.#movable(frame, header);
    return {
      content,
      bar,
      close,
      get title() {
        return heading.textContent ?? "";
      },
      set title(text) {
        heading.textContent = text;
        closing.set({ label: `Close ${text}` });
      },
    };
  }

  #place(frame: HTMLElement): void {
    this.element.append(frame);
    const offset = GAP + CASCADE * (this.#opened % 6);
    this.#opened += 1;
    this.#move(frame, offset, offset);
  }

  #movable(frame: HTMLElement, handle: HTMLElement): void {
    handle.addEventListener("pointerdown", (down) => {
      // An element that is moved while a button in it is pressed gets no click.
      if (down.button !== 0 || (down.target as HTMLElement).closest("button, select, input")) return;
      this.element.append(frame);
      const [left, top] = [frame.offsetLeft - down.clientX, frame.offsetTop - down.clientY];
      handle.setPointerCapture(down.pointerId);
      const move = (event: PointerEvent) => this.#move(frame, left + event.clientX, top + event.clientY);
      handle.addEventListener("pointermove", move);
      handle.addEventListener("lostpointercapture", () => handle.removeEventListener("pointermove", move), {
        once: true,
      });
    });
  }

  #move(frame: HTMLElement, left: number, top: number): void {
    const { clientWidth, clientHeight } = this.element;
    // The title bar stays reachable.
    frame.style.left = `${Math.max(0, Math.min(left, clientWidth - Math.min(frame.offsetWidth, clientWidth)))}px`;
    frame.style.top = `${Math.max(0, Math.min(top, clientHeight - 36))}px`;
  }
}
