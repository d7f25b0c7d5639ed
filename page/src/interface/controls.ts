import { element, uniqueId } from "./element.ts";
import { icon, type IconName } from "./icons.ts";

/** A control that can be switched off; it then says why. */
export interface Control {
  readonly element: HTMLElement;
  /** Switches the control off with a reason that the user can read, or on again with null. */
  disable(reason: string | null): void;
}

export interface Button extends Control {
  readonly element: HTMLButtonElement;
  /** Changes icon, visible text and label, for example from Pause to Resume. */
  set(options: { icon?: IconName; text?: string; label: string }): void;
  /** Shows the button pressed or not. */
  press(pressed: boolean): void;
}

export interface ButtonOptions {
  /** The visible text; without it, only the icon is visible. */
  readonly text?: string;
  readonly icon?: IconName;
  /** What it does; the tooltip, and the name for screen readers. Default: the text. */
  readonly label?: string;
  /** The key that does the same, for the tooltip, such as "Space". */
  readonly key?: string;
  readonly className?: string;
  run(): void;
}

/** Called with the reason if somebody uses a control that is off. */
let explain: (reason: string) => void = () => undefined;

/** Sets what shows the reason why a control is off. */
export function explainWith(show: (reason: string) => void): void {
  explain = show;
}

export function button(options: ButtonOptions): Button {
  const created = element("button", { type: "button", className: `button ${options.className ?? ""}`.trim() });
  const picture = element("span", { className: "picture" });
  const text = element("span", { className: "text" }, options.text ?? "");
  let label = options.label ?? options.text ?? "";
  let reason: string | null = null;
  const describe = () => {
    const key = options.key === undefined ? "" : ` (${options.key})`;
    created.title = reason === null ? label + key : `${label}: ${reason}`;
    if (options.text === undefined) created.setAttribute("aria-label", label);
  };
  if (options.icon !== undefined) {
    picture.append(icon(options.icon));
    created.append(picture);
  }
  if (options.text !== undefined) created.append(text);
  if (options.key !== undefined && options.key.length === 1) created.setAttribute("aria-keyshortcuts", options.key);
  // A button that is off keeps the focus and its tooltip, so the property `disabled` is not used.
  created.addEventListener("click", () => (reason === null ? options.run() : explain(reason)));
  describe();
  return {
    element: created,
    set: (changed) => {
      label = changed.label;
      if (changed.text !== undefined) text.textContent = changed.text;
      if (changed.icon !== undefined) picture.replaceChildren(icon(changed.icon));
      describe();
    },
    press: (pressed) => created.setAttribute("aria-pressed", String(pressed)),
    disable: (why) => {
      reason = why;
      why === null ? created.removeAttribute("aria-disabled") : created.setAttribute("aria-disabled", "true");
      describe();
    },
  };
}

/** Switches an input element and its label off. */
function disableInput(row: HTMLElement, inputs: (HTMLInputElement | HTMLSelectElement)[], reason: string | null): void {
  for (const input of inputs) input.disabled = reason !== null;
  row.classList.toggle("off", reason !== null);
  reason === null ? row.removeAttribute("title") : (row.title = reason);
}

export interface Toggle extends Control {
  value: boolean;
}

export interface ToggleOptions {
  readonly text: string;
  readonly value?: boolean;
  /** Explanation in the tooltip. */
  readonly hint?: string;
  change(value: boolean): void;
}

/** A check box with a text. */
export function toggle(options: ToggleOptions): Toggle {
  const input = element("input", { type: "checkbox", checked: options.value ?? false });
  const row = element("label", { className: "toggle" }, input, element("span", {}, options.text));
  const hint = options.hint ?? "";
  if (hint !== "") row.title = hint;
  input.addEventListener("change", () => options.change(input.checked));
  return {
    element: row,
    get value() {
      return input.checked;
    },
    set value(value) {
      input.checked = value;
    },
    disable: (reason) => {
      disableInput(row, [input], reason);
      if (reason === null && hint !== "") row.title = hint;
    },
  };
}

export interface Slider extends Control {
  /** Shows a value without calling `change`; ignored while the user moves the slider. */
  value: number;
}

export interface SliderOptions {
  readonly label: string;
  /** Such as "rad"; empty if the value has none. */
  readonly unit: string;
  readonly min: number;
  readonly max: number;
  /** Default: 1/500 of the range. */
  readonly step?: number;
  readonly value: number;
  /** Decimals of the number field. Default: 3. */
  readonly decimals?: number;
  change(value: number): void;
  /** Called when the user lets go of the slider. */
  commit?(value: number): void;
}

/** A slider with a number field and a unit. */
export function slider(options: SliderOptions): Slider {
  const { label, unit, min, max, value } = options;
  const decimals = options.decimals ?? 3;
  const step = options.step ?? (max - min) / 500;
  const id = uniqueId("slider");
  const range = element("input", { type: "range", id, min: `${min}`, max: `${max}`, step: `${step}` });
  const number = element("input", { type: "number", min: `${min}`, max: `${max}`, step: "any" });
  number.setAttribute("aria-label", unit === "" ? label : `${label} [${unit}]`);
  const row = element(
    "div",
    { className: "slider" },
    element("label", { htmlFor: id, title: label }, label),
    range,
    element("span", { className: "quantity" }, number, element("span", { className: "unit" }, unit)),
  );
  let current = value;
  let held = false;
  const show = (shown: number) => {
    current = shown;
    range.value = `${shown}`;
    if (document.activeElement !== number) number.value = shown.toFixed(decimals);
  };
  const use = (wanted: number, done: boolean) => {
    current = Math.min(max, Math.max(min, wanted));
    range.value = `${current}`;
    number.value = current.toFixed(decimals);
    options.change(current);
    if (done) options.commit?.(current);
  };
  range.addEventListener("pointerdown", () => (held = true));
  for (const end of ["pointerup", "pointercancel", "blur"]) range.addEventListener(end, () => (held = false));
  range.addEventListener("input", () => use(Number(range.value), false));
  range.addEventListener("change", () => options.commit?.(current));
  number.addEventListener("change", () => number.value !== "" && use(Number(number.value), true));
  show(value);
  return {
    element: row,
    get value() {
      return current;
    },
    set value(shown) {
      if (!held) show(shown);
    },
    disable: (reason) => disableInput(row, [range, number], reason),
  };
}

export interface Select extends Control {
  readonly select: HTMLSelectElement;
  value: string;
  /** Replaces the choices; keeps the value if it is still among them. */
  set(options: readonly Choice[]): void;
}

export interface Choice {
  readonly value: string;
  readonly text: string;
}

export interface SelectOptions {
  readonly label: string;
  readonly options: readonly Choice[];
  readonly value?: string;
  /** Whether only screen readers get the label, as in the toolbar. */
  readonly compact?: boolean;
  change(value: string): void;
}

/** A list of choices. */
export function select(options: SelectOptions): Select {
  const id = uniqueId("select");
  const list = element("select", { id });
  const label = element("label", { htmlFor: id }, options.label);
  const row = element("div", { className: "select" });
  if (options.compact === true) {
    list.setAttribute("aria-label", options.label);
    list.title = options.label;
    row.append(list);
  } else {
    row.append(label, list);
  }
  const set = (choices: readonly Choice[]) => {
    const { value } = list;
    list.replaceChildren(...choices.map((choice) => element("option", { value: choice.value }, choice.text)));
    if (choices.some((choice) => choice.value === value)) list.value = value;
  };
  set(options.options);
  if (options.value !== undefined) list.value = options.value;
  list.addEventListener("change", () => options.change(list.value));
  return {
    element: row,
    select: list,
    get value() {
      return list.value;
    },
    set value(value) {
      list.value = value;
    },
    set,
    disable: (reason) => {
      disableInput(row, [list], reason);
      list.title = reason ?? options.label;
    },
  };
}

/** A text field; `change` is called with each input. */
export function field(options: {
  readonly label: string;
  readonly placeholder?: string;
  readonly value?: string;
  readonly type?: "text" | "search" | "number";
  /** Shown behind the field. */
  readonly unit?: string;
  change(value: string): void;
}): Control & { readonly input: HTMLInputElement } {
  const input = element("input", { type: options.type ?? "text", value: options.value ?? "", spellcheck: false });
  input.placeholder = options.placeholder ?? "";
  const caption = element("span", {}, options.label);
  const row = element("label", { className: "field" }, caption, input);
  if (options.type === "search") {
    caption.className = "hidden";
    row.prepend(icon("search"));
    row.classList.add("search");
  }
  if (options.unit !== undefined) row.append(element("span", { className: "unit" }, options.unit));
  input.addEventListener("input", () => options.change(input.value));
  return { element: row, input, disable: (reason) => disableInput(row, [input], reason) };
}

/** A table of names and values with `set` for live values; a name that is new gets a row. */
export class Properties {
  readonly element = element("dl", { className: "properties" });
  readonly #values = new Map<string, HTMLElement>();

  set(name: string, value: string, hint = ""): void {
    let cell = this.#values.get(name);
    if (cell === undefined) {
      cell = element("dd");
      this.#values.set(name, cell);
      this.element.append(element("dt", {}, name), cell);
    }
    if (cell.textContent !== value) cell.textContent = value;
    if (cell.title !== hint) cell.title = hint;
  }

  clear(): void {
    this.#values.clear();
    this.element.replaceChildren();
  }
}
