import assert from "node:assert/strict";
import { test } from "node:test";
import { keyName, Shortcuts } from "../src/interface/shortcuts.ts";

const none = { shiftKey: false, ctrlKey: false, metaKey: false, altKey: false };
const named = (key: string, more = {}) => ({ key, text: key, group: "Test", run: () => undefined, ...more });

function registry(): Shortcuts {
  const shortcuts = new Shortcuts();
  for (const key of ["f", " ", "?", "Escape", "Backspace", "["]) shortcuts.add(named(key));
  shortcuts.add(named("f", { shift: true, text: "Shift F" }));
  return shortcuts;
}

test("a key starts its shortcut, with or without caps lock", () => {
  const shortcuts = registry();
  assert.equal(shortcuts.find({ ...none, key: "f" }, "none")?.text, "f");
  assert.equal(shortcuts.find({ ...none, key: "F" }, "none")?.text, "f");
  assert.equal(shortcuts.find({ ...none, key: "F", shiftKey: true }, "none")?.text, "Shift F");
  assert.equal(shortcuts.find({ ...none, key: "x" }, "none"), undefined);
});

test("a character that needs Shift on this keyboard still works, but Shift with another key does not", () => {
  const shortcuts = registry();
  assert.equal(shortcuts.find({ ...none, key: "?", shiftKey: true }, "none")?.text, "?");
  assert.equal(shortcuts.find({ ...none, key: "[", shiftKey: true }, "none")?.text, "[");
  assert.equal(shortcuts.find({ ...none, key: "Backspace", shiftKey: true }, "none"), undefined);
});

test("keys with Ctrl, Alt or Command belong to the browser", () => {
  const shortcuts = registry();
  for (const modifier of ["ctrlKey", "altKey", "metaKey"]) {
    assert.equal(shortcuts.find({ ...none, key: "f", [modifier]: true }, "none"), undefined);
  }
});

test("in a field only Escape works, and a control keeps Space for itself", () => {
  const shortcuts = registry();
  assert.equal(shortcuts.find({ ...none, key: "f" }, "field"), undefined);
  assert.equal(shortcuts.find({ ...none, key: "Escape" }, "field")?.text, "Escape");
  assert.equal(shortcuts.find({ ...none, key: " " }, "control"), undefined);
  assert.equal(shortcuts.find({ ...none, key: "f" }, "control")?.text, "f");
});

test("single characters can be switched off, except the help", () => {
  const shortcuts = registry();
  shortcuts.characters = false;
  assert.equal(shortcuts.find({ ...none, key: "f" }, "none"), undefined);
  assert.equal(shortcuts.find({ ...none, key: " " }, "none"), undefined);
  assert.equal(shortcuts.find({ ...none, key: "?" }, "none")?.text, "?");
  assert.equal(shortcuts.find({ ...none, key: "Backspace" }, "none")?.text, "Backspace");
});

test("two shortcuts cannot share a key", () => {
  assert.throws(() => registry().add(named("f")), /the key "F" is taken by "f"/);
  assert.throws(() => registry().add(named("f", { shift: true })), /the key "Shift \+ F" is taken/);
});

test("the help lists every gesture and shortcut by group", () => {
  const shortcuts = registry();
  shortcuts.gesture({ keys: "Wheel", text: "Zoom", group: "Mouse" });
  assert.deepEqual([...shortcuts.help().keys()], ["Mouse", "Test"]);
  assert.deepEqual(
    shortcuts
      .help()
      .get("Test")!
      .map(({ keys }) => keys),
    ["F", "Space", "?", "Esc", "Backspace", "[", "Shift + F"],
  );
  assert.equal(keyName({ key: "ArrowUp" }), "↑");
});
