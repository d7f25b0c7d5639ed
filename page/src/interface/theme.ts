import type { Settings } from "./settings.ts";

export type Theme = "system" | "dark" | "light";
const THEMES: readonly Theme[] = ["system", "dark", "light"];

/** Dark or light colours: those of the system, or what the user chose. */
export class Themes {
  readonly #dark = matchMedia("(prefers-color-scheme: dark)");
  readonly #listeners: (() => void)[] = [];
  #theme: Theme;

  constructor(readonly settings: Settings) {
    const stored = settings.get<string>("theme", "system");
    this.#theme = THEMES.find((theme) => theme === stored) ?? "system";
    this.#dark.addEventListener("change", () => this.#apply());
    this.#apply();
  }

  get current(): Theme {
    return this.#theme;
  }

  get dark(): boolean {
    return this.#theme === "system" ? this.#dark.matches : this.#theme === "dark";
  }

  /** Changes to the next theme and returns it. */
  next(): Theme {
    this.#theme = THEMES[(THEMES.indexOf(this.#theme) + 1) % THEMES.length]!;
    this.settings.set("theme", this.#theme);
    this.#apply();
    return this.#theme;
  }

  /** Calls a function after each change of the colours, for what CSS cannot reach, such as plots. */
  listen(listener: () => void): void {
    this.#listeners.push(listener);
  }

  /** Returns the value of a design token, such as "--accent", in the present theme. */
  token(name: string): string {
    // A colour of light-dark() is resolved only where it is used.
    const probe = document.createElement("span");
    probe.style.color = `var(${name})`;
    document.body.append(probe);
    const { color } = getComputedStyle(probe);
    probe.remove();
    return color;
  }

  #apply(): void {
    document.documentElement.dataset["theme"] = this.dark ? "dark" : "light";
    for (const listener of this.#listeners) listener();
  }
}
