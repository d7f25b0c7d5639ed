/** Signs of the velocity: forward, to the left, and turn to the left. */
export interface Direction {
  readonly x: number;
  readonly y: number;
  readonly yaw: number;
}

export const STOPPED: Direction = { x: 0, y: 0, yaw: 0 };

/** Keys of teleop_twist_keyboard, WASD and arrows, as in `KeyboardEvent.key`. */
const KEYS: ReadonlyMap<string, Direction> = new Map([
  ["i", { x: 1, y: 0, yaw: 0 }],
  [",", { x: -1, y: 0, yaw: 0 }],
  ["j", { x: 0, y: 0, yaw: 1 }],
  ["l", { x: 0, y: 0, yaw: -1 }],
  ["u", { x: 1, y: 0, yaw: 1 }],
  ["o", { x: 1, y: 0, yaw: -1 }],
  ["m", { x: -1, y: 0, yaw: -1 }],
  [".", { x: -1, y: 0, yaw: 1 }],
  ["w", { x: 1, y: 0, yaw: 0 }],
  ["s", { x: -1, y: 0, yaw: 0 }],
  ["a", { x: 0, y: 0, yaw: 1 }],
  ["d", { x: 0, y: 0, yaw: -1 }],
  ["ArrowUp", { x: 1, y: 0, yaw: 0 }],
  ["ArrowDown", { x: -1, y: 0, yaw: 0 }],
  ["ArrowLeft", { x: 0, y: 0, yaw: 1 }],
  ["ArrowRight", { x: 0, y: 0, yaw: -1 }],
]);
/** With Shift, keys that turn move to the side; these are the signs of teleop_twist_keyboard. */
const SIDEWAYS: ReadonlyMap<string, Direction> = new Map([
  ["j", { x: 0, y: 1, yaw: 0 }],
  ["l", { x: 0, y: -1, yaw: 0 }],
  ["u", { x: 1, y: 1, yaw: 0 }],
  ["o", { x: 1, y: -1, yaw: 0 }],
  ["m", { x: -1, y: 1, yaw: 0 }],
  [".", { x: -1, y: -1, yaw: 0 }],
  ["a", { x: 0, y: 1, yaw: 0 }],
  ["d", { x: 0, y: -1, yaw: 0 }],
  ["ArrowLeft", { x: 0, y: 1, yaw: 0 }],
  ["ArrowRight", { x: 0, y: -1, yaw: 0 }],
]);
/** What Shift makes of punctuation on a US keyboard. */
const SHIFTED: ReadonlyMap<string, string> = new Map([
  ["<", ","],
  [">", "."],
]);
/** Factors of the linear speed and of the yaw rate; `w` and `x` of teleop_twist_keyboard are left out because of WASD. */
const SPEEDS: ReadonlyMap<string, readonly [number, number]> = new Map([
  ["q", [1.1, 1.1]],
  ["z", [0.9, 0.9]],
  ["e", [1, 1.1]],
  ["c", [1, 0.9]],
]);

/** Returns the name of a key without the effect of Shift; empty for a key that does not drive. */
export function driveKey(key: string): string {
  const name = key.length === 1 ? key.toLowerCase() : key;
  const plain = SHIFTED.get(name) ?? name;
  return KEYS.has(plain) ? plain : "";
}

/** Returns the factors of linear speed and yaw rate for a key; undefined if it does not change them. */
export function speedKey(key: string): readonly [number, number] | undefined {
  return SPEEDS.get(key.toLowerCase());
}

/** Returns the direction of all held keys together, with each sign from -1 to 1. */
export function directionOf(held: Iterable<string>, shift: boolean): Direction {
  let { x, y, yaw } = STOPPED;
  for (const key of held) {
    const direction = (shift ? SIDEWAYS.get(key) : undefined) ?? KEYS.get(key) ?? STOPPED;
    x += direction.x;
    y += direction.y;
    yaw += direction.yaw;
  }
  return { x: limit(x), y: limit(y), yaw: limit(yaw) };
}

function limit(value: number): number {
  return Math.max(-1, Math.min(1, value));
}
