import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { test } from "node:test";

const STYLE = new URL("../../src/style.css", import.meta.url);

/** Contrast that WCAG level AA demands of text, and of the parts of controls. */
const TEXT = 4.5;
const PART = 3;

const PAIRS: readonly (readonly [string, string, number])[] = [
  ...["text", "muted", "accent", "ok", "warning", "error"].flatMap((color) =>
    ["surface", "ground"].map((ground) => [color, ground, TEXT] as const),
  ),
  ["text", "raised", TEXT],
  ["muted", "raised", TEXT],
  ["text", "hover", TEXT],
  ["text", "selected", TEXT],
  ["accent", "selected", TEXT],
  ["on-accent", "accent", TEXT],
  ["edge", "surface", PART],
];

/** Returns the relative luminance of a colour such as "#0b5fc2". */
function luminance(color: string): number {
  const [red = 0, green = 0, blue = 0] = [1, 3, 5].map((start) => {
    const part = parseInt(color.slice(start, start + 2), 16) / 255;
    return part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4;
  });
  return 0.2126 * red + 0.7152 * green + 0.0722 * blue;
}

function contrast(one: string, other: string): number {
  const [dark = 0, bright = 0] = [luminance(one), luminance(other)].sort((a, b) => a - b);
  return (bright + 0.05) / (dark + 0.05);
}

test("contrasts are those of WCAG", () => {
  assert.equal(contrast("#000000", "#ffffff"), 21);
  assert.ok(Math.abs(contrast("#777777", "#ffffff") - 4.48) < 0.01);
});

test("text and controls have enough contrast in both themes", async () => {
  const tokens = new Map<string, readonly string[]>();
  for (const [, name, light, dark] of (await readFile(STYLE, "utf8")).matchAll(
    /--([\w-]+): light-dark\((#\w{6}), (#\w{6})\)/g,
  )) {
    tokens.set(name!, [light!, dark!]);
  }
  const weak = PAIRS.flatMap(([color, ground, wanted]) =>
    [0, 1].flatMap((theme) => {
      const got = contrast(tokens.get(color)![theme]!, tokens.get(ground)![theme]!);
      return got < wanted ? [`${color} on ${ground}: ${got.toFixed(2)} in theme ${theme}`] : [];
    }),
  );
  assert.deepEqual(weak, []);
});
