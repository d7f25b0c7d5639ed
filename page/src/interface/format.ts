/** Text for numbers. The number of digits is constant where a number changes often, so that the text does not jump. */

/** Unicode minus, which is as wide as a digit in tabular figures. */
const MINUS = "−";

/** Returns a number with a constant number of decimals, without "-0". */
export function fixed(value: number, decimals: number): string {
  if (!Number.isFinite(value)) return "–";
  const text = Math.abs(value).toFixed(decimals);
  return value < 0 && Number(text) !== 0 ? MINUS + text : text;
}

/** Returns a simulated time, such as "12.345 s". */
export function formatTime(seconds: number): string {
  return `${fixed(seconds, 3)} s`;
}

/** Returns a speed relative to real time, such as "0.98×"; "max" stays as it is. */
export function formatSpeed(speed: number | "max" | null): string {
  if (speed === null) return "–";
  if (speed === "max") return "max";
  return `${fixed(speed, speed < 10 ? 2 : speed < 100 ? 1 : 0)}×`;
}

/** Returns a wall time span in words, such as "12 ms", "1.2 s" or "3 min". */
export function formatAge(seconds: number): string {
  const positive = Math.max(0, seconds);
  if (positive < 0.9995) return `${fixed(1000 * positive, 0)} ms`;
  if (positive < 59.95) return `${fixed(positive, 1)} s`;
  if (positive < 3570) return `${fixed(positive / 60, 0)} min`;
  return `${fixed(positive / 3600, 1)} h`;
}

const PREFIXES: readonly (readonly [number, string])[] = [
  [1e9, "G"],
  [1e6, "M"],
  [1e3, "k"],
  [1, ""],
  [1e-3, "m"],
  [1e-6, "µ"],
];

/** Returns a quantity with three digits and a prefix, such as "221 N" or "1.20 kN". */
export function formatQuantity(value: number, unit: string): string {
  if (!Number.isFinite(value)) return `– ${unit}`;
  // Rounded to three digits first, so that 999.9 becomes 1.00 k.
  const rounded = Number(value.toPrecision(3));
  const size = Math.abs(rounded);
  if (size === 0) return `0 ${unit}`;
  const [scale, prefix] = PREFIXES.find(([limit]) => size >= limit) ?? PREFIXES.at(-1)!;
  const scaled = rounded / scale;
  const decimals = Math.max(0, 2 - Math.floor(Math.log10(Math.abs(scaled)) + 1e-9));
  return `${fixed(scaled, Math.min(decimals, 3))} ${prefix}${unit}`;
}

/** Returns a mass, such as "8.00 kg" or "12.0 g". */
export function formatMass(kilograms: number): string {
  return kilograms >= 1000 ? `${formatQuantity(kilograms / 1000, "t")}` : formatQuantity(1000 * kilograms, "g");
}

/** Returns the rotations about the fixed axes x, y and z [rad] (roll, pitch, yaw) of a quaternion with w first. */
export function rollPitchYaw([w, x, y, z]: readonly [number, number, number, number]): [number, number, number] {
  const sine = Math.max(-1, Math.min(1, 2 * (w * y - z * x)));
  return [
    Math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
    Math.asin(sine),
    Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
  ];
}

/** Returns a count with its noun, such as "1 joint" or "3 joints". */
export function count(number: number, noun: string): string {
  return `${number} ${noun}${number === 1 ? "" : "s"}`;
}
