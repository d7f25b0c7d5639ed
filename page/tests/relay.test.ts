import assert from "node:assert/strict";
import { afterEach, beforeEach, mock, test } from "node:test";
import { Relay } from "../src/wire/relay.ts";

type Sent = Record<string, unknown> & { op: string; id?: number };

/** The other end of the page's connection. */
class Socket {
  static readonly OPEN = 1;
  static opened: Socket[] = [];
  readyState = Socket.OPEN;
  readonly sent: Sent[] = [];
  onmessage: (event: { data: string | ArrayBuffer }) => void = () => undefined;
  onclose: () => void = () => undefined;

  constructor() {
    Socket.opened.push(this);
  }

  send(text: string): void {
    this.sent.push(JSON.parse(text) as Sent);
  }

  receive(message: object): void {
    this.onmessage({ data: JSON.stringify(message) });
  }

  hello(): void {
    this.receive({ op: "hello", protocol: 1, version: "0", viewer: "v", read_only: false, servers: [] });
  }

  lose(): void {
    this.readyState = 3;
    this.onclose();
  }

  of(op: string): Sent[] {
    return this.sent.filter((message) => message.op === op);
  }

  /** Replies to the newest request to subscribe. */
  async subscribed(channel: number): Promise<void> {
    const { id } = this.of("subscribe").at(-1)!;
    this.receive({
      op: "reply",
      id,
      ok: true,
      response: { channel, type: "std_msgs/msg/Bool", definition: "bool data" },
    });
    await settled();
  }

  async refused(): Promise<void> {
    this.receive({ op: "reply", id: this.of("subscribe").at(-1)!.id, ok: false, error: "no such topic" });
    await settled();
  }

  /** Sends one sample. */
  sample(channel: number, value: boolean): void {
    const view = new DataView(new ArrayBuffer(16 + 8 + 8));
    view.setUint8(0, 3);
    view.setUint16(2, channel, true);
    view.setUint32(16, 5, true);
    view.setUint8(25, 1);
    view.setUint8(28, Number(value));
    this.onmessage({ data: view.buffer });
  }
}

const original = globalThis.WebSocket;

async function settled(): Promise<void> {
  for (let turn = 0; turn < 10; turn += 1) await Promise.resolve();
}

beforeEach(() => {
  Socket.opened = [];
  globalThis.WebSocket = Socket as unknown as typeof WebSocket;
  mock.timers.enable({ apis: ["setTimeout"] });
  mock.method(console, "warn", () => undefined);
});

afterEach(() => {
  globalThis.WebSocket = original;
  mock.timers.reset();
  mock.restoreAll();
});

/** Returns a page that is subscribed to a topic, and what it got of it. */
async function opened() {
  const relay = new Relay(new URL("ws://localhost/socket"));
  const first = Socket.opened[0]!;
  first.hello();
  const received: unknown[] = [];
  const opening = relay.subscribe("/switch", "all", (samples) =>
    received.push(...samples.map((s) => s.message["data"])),
  );
  await first.subscribed(7);
  return { first, received, subscription: await opening };
}

/** Loses the connection, and returns the next one. */
function reconnected(before: Socket): Socket {
  before.lose();
  mock.timers.tick(1000);
  const next = Socket.opened.at(-1)!;
  assert.notEqual(next, before);
  next.hello();
  return next;
}

test("after a lost connection, a topic is delivered by its new channel only", async () => {
  const { first, received } = await opened();
  first.sample(7, true);
  const next = reconnected(first);
  next.sample(7, true);
  await next.subscribed(2);
  next.sample(7, true);
  next.sample(2, false);
  assert.deepEqual(received, [true, false]);
});

test("a topic that is not there after a lost connection is asked for until it is", async () => {
  const { first, received } = await opened();
  const next = reconnected(first);
  await next.refused();
  mock.timers.tick(3000);
  assert.equal(next.of("subscribe").length, 2);
  await next.refused();
  mock.timers.tick(3000);
  await next.subscribed(1);
  next.sample(1, true);
  assert.deepEqual(received, [true]);
  mock.timers.tick(60_000);
  assert.equal(next.of("subscribe").length, 3);
});

test("a topic that is closed while it is subscribed to again is unsubscribed from", async () => {
  const { first, received, subscription } = await opened();
  const next = reconnected(first);
  subscription.close();
  assert.deepEqual(next.of("unsubscribe"), []);
  await next.subscribed(3);
  assert.deepEqual(next.of("unsubscribe"), [{ op: "unsubscribe", channel: 3 }]);
  next.sample(3, true);
  assert.deepEqual(received, []);
});

test("a topic that is closed while it is missing is not asked for again", async () => {
  const { first, subscription } = await opened();
  const next = reconnected(first);
  await next.refused();
  subscription.close();
  mock.timers.tick(60_000);
  assert.equal(next.of("subscribe").length, 1);
  assert.deepEqual(next.of("unsubscribe"), []);
});

test("a second lost connection does not lead to two subscriptions", async () => {
  const { first } = await opened();
  const next = reconnected(first);
  await next.refused();
  const last = reconnected(next);
  mock.timers.tick(60_000);
  assert.equal(last.of("subscribe").length, 1);
});

const servers = (...names: string[]) => names.map((name, id) => ({ id, name, connected: true }));

test("a server that is found only after the connection is watched again, once", () => {
  const relay = new Relay(new URL("ws://localhost/socket"));
  const first = Socket.opened[0]!;
  first.hello();
  first.receive({ op: "servers", servers: servers("/a") });
  relay.watch(0, true);
  relay.overlay(0, "contacts", true);
  const next = reconnected(first);
  assert.deepEqual([...next.of("watch"), ...next.of("overlay")], []);
  for (let time = 0; time < 2; time += 1) {
    next.receive({ op: "servers", servers: servers("/a") });
    assert.deepEqual(next.of("watch"), [{ op: "watch", server: 0, on: true }]);
    assert.deepEqual(next.of("overlay"), [{ op: "overlay", server: 0, kind: "contacts", on: true }]);
  }
});

test("the page is loaded again if the ids of servers belong to others after a lost connection", () => {
  const reload = mock.fn();
  Object.defineProperty(globalThis, "location", { value: { reload }, configurable: true });
  const relay = new Relay(new URL("ws://localhost/socket"));
  const first = Socket.opened[0]!;
  first.hello();
  first.receive({ op: "servers", servers: servers("/a", "/b") });
  relay.watch(0, true);
  const next = reconnected(first);
  next.receive({ op: "servers", servers: servers("/a", "/b", "/c") });
  assert.equal(reload.mock.callCount(), 0);
  const last = reconnected(next);
  last.receive({ op: "servers", servers: servers("/b", "/a") });
  assert.equal(reload.mock.callCount(), 1);
  assert.deepEqual(last.of("watch"), []);
});
