import assert from "node:assert/strict";
import { test } from "node:test";
import { commandable, Jog, JointCommands, jointRange } from "../src/drive/jog.ts";
import type { Direction } from "../src/drive/keymap.ts";
import { Teleop } from "../src/drive/teleop.ts";
import type { App } from "../src/app.ts";
import type { Fields, Info, JointInfo } from "../src/wire/protocol.ts";

/** What a target has been told: directions as "x y yaw", and stops. */
function armed(): { teleop: Teleop; sent: string[]; speeds: number[][] } {
  const sent: string[] = [];
  const speeds: number[][] = [];
  const teleop = new Teleop(
    () => undefined,
    (...factors) => speeds.push(factors),
  );
  teleop.arm({
    send: ({ x, y, yaw }: Direction) => sent.push(`${x} ${y} ${yaw}`),
    stop: () => sent.push("stop"),
  });
  return { teleop, sent, speeds };
}

test("nothing is sent before it is armed and after it is disarmed", () => {
  const teleop = new Teleop(
    () => undefined,
    () => undefined,
  );
  assert.equal(teleop.keyDown("i", false), false);
  teleop.touch({ x: 1, y: 0, yaw: 0 });
  teleop.tick();
  const { teleop: other, sent } = armed();
  other.disarm();
  other.keyDown("i", false);
  other.tick();
  assert.deepEqual(sent, ["stop"]);
});

test("a held key is repeated, and its release stops once", () => {
  const { teleop, sent } = armed();
  teleop.keyDown("i", false);
  teleop.tick();
  teleop.keyUp("i", false);
  teleop.tick();
  teleop.tick();
  assert.deepEqual(sent, ["1 0 0", "1 0 0", "stop"]);
});

test("two keys drive together until both are released", () => {
  const { teleop, sent } = armed();
  teleop.keyDown("w", false);
  teleop.keyDown("a", false);
  teleop.keyUp("w", false);
  teleop.keyUp("a", false);
  assert.deepEqual(sent, ["1 0 0", "1 0 1", "0 0 1", "stop"]);
});

test("a key that was pressed with Shift is released without it", () => {
  const { teleop, sent } = armed();
  teleop.keyDown("J", true);
  teleop.keyUp("Shift", false);
  teleop.keyUp("j", false);
  assert.deepEqual(sent, ["0 1 0", "0 0 1", "stop"]);
});

test("Space, k and a loss of the focus stop while the key is still down", () => {
  for (const stop of [" ", "k", ""]) {
    const { teleop, sent } = armed();
    teleop.keyDown("i", false);
    stop === "" ? teleop.release() : teleop.keyDown(stop, false);
    teleop.tick();
    assert.deepEqual(sent, ["1 0 0", "stop"]);
    assert.equal(teleop.armed, true);
  }
});

test("Escape stops and disarms; keys of other features are left to them", () => {
  const { teleop, sent, speeds } = armed();
  teleop.keyDown("i", false);
  assert.equal(teleop.keyDown("f", false), false);
  assert.equal(teleop.keyDown("q", false), true);
  assert.deepEqual(speeds, [[1.1, 1.1]]);
  assert.equal(teleop.keyDown("Escape", false), true);
  assert.equal(teleop.armed, false);
  assert.deepEqual(sent, ["1 0 0", "stop"]);
});

test("a gamepad drives in proportion, and the middle of its sticks is zero", () => {
  const { teleop, sent } = armed();
  teleop.gamepad([0.1, -0.5, 0], false);
  teleop.tick();
  teleop.gamepad([-1, 0.05, 0.5], false);
  teleop.tick();
  teleop.gamepad([-1, -1, 0], true);
  teleop.tick();
  assert.deepEqual(sent, ["0.5 0 0", "0 -0.5 1", "stop"]);
});

const ELBOW: JointInfo = { name: "elbow", type: "hinge", body: 1, range: [-1, 0.5] };

test("a jog moves from the measured position at its speed, and not beyond the limits", () => {
  const published: Fields[] = [];
  const source = { publish: (_: number, __: string, ___: string, message: Fields) => published.push(message) };
  const topic = { name: "/arm/joint_commands", type: "t", publishers: 0, subscribers: 1, server: 0 };
  const commands = new JointCommands({ source } as unknown as App, topic);
  const jog = new Jog(
    commands,
    () => ELBOW,
    () => 2,
  );
  jog.send({ x: 1, y: 0, yaw: 0 });
  assert.deepEqual(published, []);
  commands.measured.set("elbow", 0.25);
  for (let step = 0; step < 4; step += 1) jog.send({ x: 1, y: 0, yaw: 0 });
  const positions = published.map((message) => (message["position"] as number[])[0]!);
  [0.35, 0.45, 0.5, 0.5].forEach((value, index) => assert.ok(Math.abs(positions[index]! - value) < 1e-12));
  jog.stop();
  commands.measured.set("elbow", 0.4);
  jog.send({ x: -1, y: 0, yaw: 0 });
  assert.ok(Math.abs((published.at(-1)!["position"] as number[])[0]! - 0.3) < 1e-12);
});

test("joints with an actuator come first, and unlimited ones get a range", () => {
  const joint = (name: string, type: JointInfo["type"]) => ({ name, type, body: 0, range: null });
  const joints = [joint("a", "hinge"), joint("b", "free"), joint("c", "slide"), joint("", "hinge"), ELBOW];
  const info = { joints, actuators: [{ name: "servo", controls: [], joint: 2 }] } as unknown as Info;
  assert.deepEqual(
    commandable(info).actuated.map(({ name }) => name),
    ["c"],
  );
  assert.deepEqual(
    commandable(info).others.map(({ name }) => name),
    ["a", "elbow"],
  );
  assert.deepEqual(commandable({ ...info, actuators: [] }).actuated.length, 3);
  assert.deepEqual(jointRange(joint("a", "hinge")), [-Math.PI, Math.PI]);
  assert.deepEqual(jointRange(ELBOW), [-1, 0.5]);
});
