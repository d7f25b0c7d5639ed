import type { World } from "../scene/world.ts";

/** A body of a server. */
export interface Selected {
  readonly world: World;
  readonly body: number;
}

/** The selected body, if any. */
export class Selection {
  #selected: Selected | null = null;
  readonly #listeners: ((selected: Selected | null) => void)[] = [];

  get current(): Selected | null {
    return this.#selected;
  }

  select(selected: Selected | null): void {
    this.#selected = selected;
    for (const listener of this.#listeners) listener(selected);
  }

  listen(listener: (selected: Selected | null) => void): void {
    this.#listeners.push(listener);
  }
}
