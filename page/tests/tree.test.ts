import assert from "node:assert/strict";
import { test } from "node:test";
import { treeRows } from "../src/interface/tree.ts";

const NAMES = ["world", "base", "left_hip", "left_foot", "right_hip", "box"];
const PARENTS = [0, 0, 1, 2, 1, 0];
const ids = (search: string, folded: number[] = []) =>
  treeRows(PARENTS, NAMES, search, new Set(folded)).map(({ id }) => id);

test("without a search, all nodes are shown, each below its parent", () => {
  const rows = treeRows(PARENTS, NAMES, "", new Set());
  assert.deepEqual(
    rows.map(({ id }) => id),
    [0, 1, 2, 3, 4, 5],
  );
  assert.deepEqual(
    rows.map(({ depth }) => depth),
    [0, 1, 2, 3, 2, 1],
  );
  assert.deepEqual(
    rows.map(({ children }) => children),
    [2, 2, 1, 0, 0, 0],
  );
});

test("children follow their parent also if the list is in another order", () => {
  assert.deepEqual(
    treeRows([0, 0, 0, 1], ["a", "b", "c", "d"], "", new Set()).map(({ id }) => id),
    [0, 1, 3, 2],
  );
});

test("a search keeps matches and their ancestors, in any case of letters", () => {
  assert.deepEqual(ids("FOOT"), [0, 1, 2, 3]);
  assert.deepEqual(ids("hip"), [0, 1, 2, 4]);
  const rows = treeRows(PARENTS, NAMES, "foot", new Set());
  assert.deepEqual(
    rows.filter(({ match }) => match).map(({ id }) => id),
    [3],
  );
});

test("a search that nothing matches shows nothing, and spaces around it do not count", () => {
  assert.deepEqual(ids("arm"), []);
  assert.deepEqual(ids(" box "), [0, 5]);
});

test("a folded node hides what is below it, but not from a search", () => {
  assert.deepEqual(ids("", [1]), [0, 1, 5]);
  assert.deepEqual(ids("foot", [1]), [0, 1, 2, 3]);
});

test("nodes with equal names are all found, and no nodes are no lines", () => {
  assert.deepEqual(
    treeRows([0, 0, 0], ["w", "a", "a"], "a", new Set()).map(({ id }) => id),
    [0, 1, 2],
  );
  assert.deepEqual(treeRows([], [], "", new Set()), []);
});
