import type { World } from "../scene/world.ts";

/** A body of a server. */
export interface Selected {
  readonly world: World;
  readonly body: number;
  /** Where it was picked, in the body's frame [m]; a drag that starts beside the body pulls at this point. */
  readonly local?: readonly [number, number, number];
}

/** The selected body, if any. */
export class Selection {
  #selected: Selected | null = null;
  readonly #listeners: ((selected: Selected | null) => void)[] = [];

  get current(): Selected | null {
    return this.#selected;
  }

  select(selected: Selected | null): void {
    if (selected === null && this.#selected === null) return;
    this.#selected = selected;
    for (const listener of this.#listeners) listener(selected);
  }

  listen(listener: (selected: Selected | null) => void): void {
    this.#listeners.push(listener);
  }
}

/** Returns the name of a body, also of one without a name. */
export function bodyName(world: World, body: number): string {
  return world.pack.header.bodies[body]?.name || `body ${body}`;
}
