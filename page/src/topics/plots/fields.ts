/** Fields of messages: which numbers a message contains, and how to read one of them by its path. */

/** A number in a message. */
export interface NumberField {
  /** Such as `twist.linear.x`, `ranges[3]` or `position[elbow]`. */
  readonly path: string;
  readonly value: number;
}

/** Reads one number of a message; undefined if the message does not contain it. */
export type ReadField = (message: unknown) => number | undefined;

type Step = { readonly name: string } | { readonly index: number } | { readonly key: string };
type Values = { readonly [name: string]: unknown };

/** Fields with the names of the elements of arrays beside them. */
const NAMES = ["name", "names", "joint_names"];
/** Fields with the name of an element in an array of messages. */
const KEYS = ["name", "child_frame_id", "joint_name", "ns"];

/** Returns at most `most` numbers of a message, with their paths. Of long arrays, the first `perArray` are listed. */
export function listFields(message: unknown, most = 2000, perArray = 64): NumberField[] {
  const found: NumberField[] = [];
  const visit = (value: unknown, path: string, parent: unknown, own: string) => {
    if (found.length >= most) return;
    const number = asNumber(value);
    if (number !== undefined) {
      found.push({ path, value: number });
    } else if (isArray(value)) {
      const keys = elementKeys(value, parent, own);
      for (let index = 0; index < Math.min(value.length, perArray); index += 1) {
        visit(value[index], `${path}[${keys?.[index] ?? index}]`, value, "");
      }
    } else if (isFields(value)) {
      for (const [name, inner] of Object.entries(value))
        visit(inner, path === "" ? name : `${path}.${name}`, value, name);
    }
  };
  visit(message, "", null, "");
  return found;
}

/**
 * Returns a function that reads a number.
 *
 * @throws Error if the path is malformed.
 */
export function fieldReader(path: string): ReadField {
  const steps = parsePath(path);
  return (message) => {
    let value = message;
    let parent: unknown = null;
    let name = "";
    for (const step of steps) {
      const inner = follow(value, step, parent, name);
      parent = value;
      name = "name" in step ? step.name : "";
      value = inner;
    }
    return asNumber(value);
  };
}

function follow(value: unknown, step: Step, parent: unknown, name: string): unknown {
  if ("name" in step) return isFields(value) ? value[step.name] : undefined;
  if (!isArray(value)) return undefined;
  if ("index" in step) return value[step.index];
  const index = elementKeys(value, parent, name)?.indexOf(step.key) ?? -1;
  return index < 0 ? undefined : value[index];
}

function parsePath(path: string): Step[] {
  const steps: Step[] = [];
  const pattern = /(?:^|\.)([A-Za-z_]\w*)|\[([^\]]*)\]/y;
  while (pattern.lastIndex < path.length) {
    const at = pattern.lastIndex;
    const match = pattern.exec(path);
    if (match === null || (at === 0 && match[1] === undefined)) {
      throw new Error(`"${path}" is no field: expected a name or an index at "${path.slice(at)}".`);
    }
    const [, name, key] = match;
    if (name !== undefined) steps.push({ name });
    else steps.push(/^\d+$/.test(key!) ? { index: Number(key) } : { key: key! });
  }
  if (steps.length === 0) throw new Error("The field is empty.");
  return steps;
}

/** Returns the names of the elements of an array, if all of them have different names that a path can contain. */
function elementKeys(array: ArrayLike<unknown>, parent: unknown, own: string): string[] | null {
  let keys: unknown[] | null = null;
  if (array.length > 0 && isFields(array[0])) {
    const key = KEYS.find((candidate) => typeof (array[0] as Values)[candidate] === "string");
    if (key !== undefined) keys = Array.from(array, (element) => (element as Values)[key]);
  } else if (isFields(parent) && !NAMES.includes(own)) {
    const beside = NAMES.map((name) => parent[name]).find((names) => isArray(names) && names.length === array.length);
    if (beside !== undefined) keys = Array.from(beside as ArrayLike<unknown>);
  }
  if (keys === null || new Set(keys).size !== keys.length) return null;
  const usable = keys.every((key) => typeof key === "string" && key !== "" && !/\]|^\d+$/.test(key));
  return usable ? (keys as string[]) : null;
}

function asNumber(value: unknown): number | undefined {
  if (typeof value === "number") return value;
  if (typeof value === "bigint" || typeof value === "boolean") return Number(value);
  return undefined;
}

function isArray(value: unknown): value is ArrayLike<unknown> {
  return Array.isArray(value) || (ArrayBuffer.isView(value) && !(value instanceof DataView));
}

function isFields(value: unknown): value is Values {
  return typeof value === "object" && value !== null && !isArray(value);
}
