import type { Frame } from "../scene/frame.ts";
import type { Stage } from "../scene/stage.ts";
import type { Info, Server } from "../wire/protocol.ts";
import type { Source } from "../wire/source.ts";
import type { Settings } from "./settings.ts";

/** Which servers are shown, and which of them the toolbar controls. */
export class Servers {
  readonly #shown = new Set<number>();
  readonly #listeners: (() => void)[] = [];
  #current: number | null = null;

  constructor(
    readonly source: Source,
    readonly stage: Stage,
    readonly settings: Settings,
  ) {
    source.listen({
      onServers: () => this.#update(),
      onInfo: () => this.#notify(),
      onState: () => this.#notify(),
    });
    if (source.servers.length > 0) this.#update();
  }

  /** The server that the toolbar controls; null until one has been found. */
  get current(): Server | null {
    return this.source.servers.find(({ id }) => id === this.#current) ?? null;
  }

  get info(): Info | null {
    return this.#current === null ? null : (this.source.infos.get(this.#current) ?? null);
  }

  /** The newest frame of the current server. */
  get frame(): Frame | null {
    return this.#current === null ? null : (this.stage.worlds.get(this.#current)?.frame ?? null);
  }

  /** Whether the current server is paused; the frames say it sooner than the information. */
  get paused(): boolean {
    return this.frame?.paused ?? this.info?.paused ?? false;
  }

  isShown(server: number): boolean {
    return this.#shown.has(server);
  }

  /** Makes a server the one that the toolbar controls, and shows it. */
  choose(server: number): void {
    const before = this.#current;
    this.#current = server;
    if (before !== null && before !== server && this.#shown.size === 1) this.#set(before, false);
    this.#set(server, true);
    this.#remember();
    this.#notify();
  }

  /** Shows or hides a server in the scene; the current one stays. */
  show(server: number, on: boolean): void {
    if (!on && server === this.#current) return;
    this.#set(server, on);
    this.#remember();
    this.#notify();
  }

  /** Calls a function after each change of the servers, of what is known of them, or of the connection. */
  listen(listener: () => void): void {
    this.#listeners.push(listener);
    listener();
  }

  #update(): void {
    const { servers } = this.source;
    const names = this.settings.get("servers", "").split(" ");
    for (const { id, name } of servers) if (names.includes(name)) this.#set(id, true);
    if (this.current === null) {
      const remembered = servers.find(({ name, connected }) => connected && name === names[0]);
      const first = remembered ?? servers.find(({ connected }) => connected) ?? servers[0];
      this.#current = first?.id ?? null;
      if (first !== undefined) this.#set(first.id, true);
    }
    this.#notify();
  }

  #set(server: number, on: boolean): void {
    if (this.#shown.has(server) === on) return;
    on ? this.#shown.add(server) : this.#shown.delete(server);
    this.source.watch(server, on);
    if (!on) this.stage.remove(server);
  }

  #remember(): void {
    const shown = this.source.servers.filter(({ id }) => this.#shown.has(id) && id !== this.#current);
    this.settings.set("servers", [this.current?.name ?? "", ...shown.map(({ name }) => name)].join(" "));
  }

  #notify(): void {
    for (const listener of this.#listeners) listener();
  }
}
