/** A key that does something while no input field has the focus. */
export interface Shortcut {
  /** As in `KeyboardEvent.key`, such as "f" or "?"; letters are lower case. */
  readonly key: string;
  readonly shift?: boolean;
  /** What it does, for the help, such as "Fit the model into the picture". */
  readonly text: string;
  readonly group: string;
  run(): void;
}

/** Something that the mouse or fingers do; the help lists it. */
export interface Gesture {
  /** Such as "Ctrl + right drag". */
  readonly keys: string;
  readonly text: string;
  readonly group: string;
}

/** The part of a keyboard event that decides which shortcut it is. */
export interface Key {
  readonly key: string;
  readonly shiftKey: boolean;
  readonly ctrlKey: boolean;
  readonly metaKey: boolean;
  readonly altKey: boolean;
}

/** What has the focus: text is typed into a field; a control uses Space, Enter and arrows itself. */
export type Focus = "field" | "control" | "none";

const OF_CONTROLS = new Set([" ", "Enter", "ArrowUp", "ArrowDown", "ArrowLeft", "ArrowRight", "Home", "End"]);
const NAMES: Readonly<Record<string, string>> = {
  " ": "Space",
  Escape: "Esc",
  ArrowUp: "↑",
  ArrowDown: "↓",
  ArrowLeft: "←",
  ArrowRight: "→",
};

/** Returns how a shortcut's key is written, such as "Shift + F". */
export function keyName({ key, shift }: Pick<Shortcut, "key" | "shift">): string {
  const name = NAMES[key] ?? (key.length === 1 ? key.toUpperCase() : key);
  return shift === true ? `Shift + ${name}` : name;
}

/** All shortcuts and gestures of the page. */
export class Shortcuts {
  /** Whether keys of a single character work; the user may switch them off. */
  characters = true;
  readonly #shortcuts: Shortcut[] = [];
  readonly #gestures: Gesture[] = [];

  /** @throws Error if another shortcut has the same key. */
  add(shortcut: Shortcut): void {
    const taken = this.#shortcuts.find((other) => same(other, shortcut));
    if (taken !== undefined) {
      throw new Error(`the key "${keyName(shortcut)}" is taken by "${taken.text}"`);
    }
    this.#shortcuts.push(shortcut);
  }

  gesture(gesture: Gesture): void {
    this.#gestures.push(gesture);
  }

  /** Returns the shortcut that a key starts, if any. "?" and Escape always work outside fields. */
  find(key: Key, focus: Focus): Shortcut | undefined {
    if (key.ctrlKey || key.metaKey || key.altKey) return undefined;
    if (focus === "field" && key.key !== "Escape") return undefined;
    if (focus === "control" && OF_CONTROLS.has(key.key)) return undefined;
    if (!this.characters && key.key.length === 1 && key.key !== "?") return undefined;
    const name = key.key.length === 1 ? key.key.toLowerCase() : key.key;
    return (
      this.#shortcuts.find((entry) => entry.key === name && entry.shift === true && key.shiftKey) ??
      // Punctuation such as "?" needs Shift on some keyboards and not on others.
      this.#shortcuts.find((entry) => entry.key === name && entry.shift !== true && (!key.shiftKey || !isLetter(name)))
    );
  }

  /** Returns what the help shows, by group in the order of registration. */
  help(): Map<string, { keys: string; text: string }[]> {
    const groups = new Map<string, { keys: string; text: string }[]>();
    const rows = [
      ...this.#gestures,
      ...this.#shortcuts.map((entry) => ({ keys: keyName(entry), text: entry.text, group: entry.group })),
    ];
    for (const { group, keys, text } of rows) {
      const entries = groups.get(group) ?? [];
      groups.set(group, [...entries, { keys, text }]);
    }
    return groups;
  }
}

function same(one: Shortcut, other: Shortcut): boolean {
  return one.key === other.key && (one.shift ?? false) === (other.shift ?? false);
}

function isLetter(name: string): boolean {
  return name.length !== 1 || /[a-z]/.test(name);
}
