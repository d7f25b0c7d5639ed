import { Decoder } from "./decoder.ts";
import type { Fields, Info, Interfaces, Item, Message, Request, Server, Subscribed } from "./protocol.ts";
import * as protocol from "./protocol.ts";
import type { Drag, Picture, Sample, Source, SourceListener, SourceState, Subscription } from "./source.ts";

/** Pause before the next attempt to connect [ms]. */
const RETRY = 1000;
/** Pause before a topic that could not be subscribed to after a lost connection is asked for again [ms]. */
const RESUBSCRIBE = 3000;

interface Pending {
  resolve(response: Fields): void;
  reject(error: Error): void;
}

interface Channel {
  readonly topic: string;
  readonly mode: protocol.SubscriptionMode;
  /** Number that the relay gave it; -1 while it is not subscribed to. */
  id: number;
  /** Counts requests, so that replies to earlier ones are recognised. */
  attempt: number;
  deliver(item: Item): void;
  opened(subscribed: Subscribed): void;
}

/** The source that is served by `mjplug view` over a WebSocket. It reconnects, and then asks again for what was watched. */
export class Relay implements Source {
  readonly recorded = false;
  readonly infos = new Map<number, Info>();
  readOnly = false;
  servers: readonly Server[] = [];
  state: SourceState = { connected: false, text: "Connecting …" };

  readonly #listeners: SourceListener[] = [];
  readonly #pending = new Map<number, Pending>();
  readonly #watched = new Set<number>();
  /** Servers of this connection for which everything was asked for that was asked for before. */
  readonly #resumed = new Set<number>();
  /** Names of all servers since the page was loaded, by id. */
  readonly #names = new Map<number, string>();
  readonly #overlays = new Map<string, { server: number; kind: string }>();
  readonly #channels = new Set<Channel>();
  #socket: WebSocket | null = null;
  #id = 0;
  #batch = 0;
  #acknowledged = 0;

  constructor(readonly url: URL) {
    this.#connect();
  }

  listen(listener: SourceListener): void {
    this.#listeners.push(listener);
  }

  watch(server: number, on: boolean): void {
    on ? this.#watched.add(server) : this.#watched.delete(server);
    this.#send({ op: "watch", server, on });
  }

  overlay(server: number, kind: string, on: boolean): void {
    const key = `${server} ${kind}`;
    on ? this.#overlays.set(key, { server, kind }) : this.#overlays.delete(key);
    this.#send({ op: "overlay", server, kind: kind as protocol.OverlayKind, on });
  }

  async scene(hash: string): Promise<ArrayBuffer> {
    const response = await fetch(`scene/${hash}`);
    if (!response.ok) {
      throw new Error(`The model cannot be loaded: ${await response.text()}`);
    }
    return response.arrayBuffer();
  }

  drawn(): void {
    if (this.#batch !== this.#acknowledged) {
      this.#acknowledged = this.#batch;
      this.#write({ op: "ack", batch: this.#batch });
    }
  }

  async interfaces(): Promise<Interfaces> {
    return (await this.#ask({ op: "topics" })) as unknown as Interfaces;
  }

  call(server: number, service: string, request: Fields = {}): Promise<Fields> {
    return this.#ask({ op: "call", server, service, request });
  }

  publish(server: number, topic: string, type: string, message: Fields, stop?: Fields, timeout?: number): void {
    const guard = stop === undefined ? {} : { stop, timeout: timeout ?? 0.5 };
    this.#send({ op: "publish", server, topic, type, message, ...guard });
  }

  drag(server: number, drag: Drag | null): void {
    this.#send(drag === null ? { op: "drag", server, release: true } : { op: "drag", server, ...drag });
  }

  async subscribe(
    topic: string,
    mode: "newest" | "all",
    onSamples: (samples: Sample[]) => void,
  ): Promise<Subscription> {
    let decoder: Decoder | null = null;
    return this.#open({
      topic,
      mode,
      id: -1,
      attempt: 0,
      opened: (subscribed) => {
        decoder = new Decoder(subscribed.definition);
      },
      deliver: (item) => decoder !== null && onSamples(decoder.samples(item.payload)),
    });
  }

  async subscribeImages(topic: string, onPicture: (picture: Picture) => void): Promise<Subscription> {
    return this.#open({
      topic,
      mode: "image",
      id: -1,
      attempt: 0,
      opened: () => undefined,
      deliver: ({ payload }) =>
        onPicture({
          file: new Blob([new Uint8Array(payload.buffer, payload.byteOffset + 24)]),
          width: payload.getUint32(8, true),
          height: payload.getUint32(12, true),
          time: payload.getFloat64(16, true),
        }),
    });
  }

  async #open(channel: Channel): Promise<Subscription> {
    const subscribed = (await this.#ask(subscription(channel))) as unknown as Subscribed;
    channel.opened(subscribed);
    channel.id = subscribed.channel;
    this.#channels.add(channel);
    return {
      type: subscribed.type,
      close: () => {
        if (!this.#channels.delete(channel)) return;
        channel.attempt += 1;
        if (channel.id >= 0) this.#send({ op: "unsubscribe", channel: channel.id });
      },
    };
  }

  #connect(): void {
    const socket = new WebSocket(this.url);
    socket.binaryType = "arraybuffer";
    socket.onmessage = ({ data }) => {
      if (typeof data === "string") {
        this.#text(JSON.parse(data));
      } else {
        this.#item(protocol.readItem(data));
      }
    };
    socket.onclose = () => this.#closed();
    this.#socket = socket;
  }

  #closed(): void {
    this.#setState({ connected: false, text: "mjplug view does not answer. Connecting again …" });
    for (const { reject } of this.#pending.values()) {
      reject(new Error("the connection to mjplug view was lost"));
    }
    this.#pending.clear();
    setTimeout(() => this.#connect(), RETRY);
  }

  #setState(state: SourceState): void {
    this.state = state;
    for (const listener of this.#listeners) listener.onState?.(state);
  }

  #setServers(servers: readonly Server[]): void {
    if (servers.some(({ id, name }) => (this.#names.get(id) ?? name) !== name)) {
      // `mjplug view` was started again and found the servers in another order. What the user chose is kept by name.
      location.reload();
      return;
    }
    for (const { id, name } of servers) this.#names.set(id, name);
    this.servers = servers;
    this.#resume();
    for (const listener of this.#listeners) listener.onServers?.(servers);
  }

  #text(message: Message): void {
    if (message.op === "hello") {
      this.readOnly = message.read_only;
      this.#batch = this.#acknowledged = 0;
      this.#setState({ connected: true, text: "" });
      this.#resumed.clear();
      this.#setServers(message.servers);
      for (const channel of this.#channels) void this.#resubscribe(channel);
    } else if (message.op === "servers") {
      this.#setServers(message.servers);
    } else if (message.op === "info") {
      this.infos.set(message.server, message.info);
      for (const listener of this.#listeners) listener.onInfo?.(message.server, message.info);
    } else if (message.op === "reply") {
      const pending = this.#pending.get(message.id);
      this.#pending.delete(message.id);
      message.ok ? pending?.resolve(message.response) : pending?.reject(new Error(message.error));
    } else {
      console.warn(message.error);
      for (const listener of this.#listeners) listener.onError?.(message.error);
    }
  }

  #item(item: Item): void {
    this.#batch = item.batch;
    if (item.kind === protocol.FRAME) {
      for (const listener of this.#listeners) listener.onFrame?.(item.server, item.payload);
    } else if (item.kind === protocol.OVERLAY) {
      const kind = protocol.OVERLAY_KINDS[item.channel]!;
      for (const listener of this.#listeners) listener.onOverlay?.(item.server, kind, item.payload);
    } else {
      for (const channel of this.#channels) if (channel.id === item.channel) channel.deliver(item);
    }
  }

  /** Asks again for what was asked for before the connection was lost; a server may be found only some time after. */
  #resume(): void {
    for (const { id } of this.servers) {
      if (this.#resumed.has(id)) continue;
      this.#resumed.add(id);
      if (this.#watched.has(id)) this.#send({ op: "watch", server: id, on: true });
      for (const { server, kind } of this.#overlays.values()) if (server === id) this.overlay(server, kind, true);
    }
  }

  /** Subscribes again; if the topic is not there yet, for example because its server starts too, tries again later. */
  async #resubscribe(channel: Channel): Promise<void> {
    channel.id = -1;
    channel.attempt += 1;
    const { attempt } = channel;
    try {
      const subscribed = (await this.#ask(subscription(channel))) as unknown as Subscribed;
      if (attempt === channel.attempt) {
        channel.opened(subscribed);
        channel.id = subscribed.channel;
      } else {
        // It was closed meanwhile.
        this.#send({ op: "unsubscribe", channel: subscribed.channel });
      }
    } catch (error) {
      console.warn(`${channel.topic}: ${(error as Error).message}`);
      setTimeout(() => attempt === channel.attempt && this.state.connected && this.#resubscribe(channel), RESUBSCRIBE);
    }
  }

  #ask(request: Request): Promise<Fields> {
    if (!this.state.connected) {
      return Promise.reject(new Error(this.state.text));
    }
    this.#id += 1;
    this.#write({ ...request, id: this.#id });
    return new Promise((resolve, reject) => this.#pending.set(this.#id, { resolve, reject }));
  }

  #send(request: Request): void {
    if (this.state.connected) this.#write(request);
  }

  #write(message: object): void {
    if (this.#socket?.readyState === WebSocket.OPEN) this.#socket.send(JSON.stringify(message));
  }
}

function subscription({ topic, mode }: Channel): Request {
  return { op: "subscribe", topic, mode };
}
