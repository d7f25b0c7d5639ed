import type { Interfaces, ServiceEntry, TopicEntry } from "../wire/protocol.ts";
import type { Source } from "../wire/source.ts";

/** Time between two requests of the list while somebody uses it [ms]. */
const PERIOD = 3000;

/** The topics and services of all servers, asked for again while somebody uses them. */
export class InterfaceList {
  topics: readonly TopicEntry[] = [];
  services: readonly ServiceEntry[] = [];
  readonly #listeners: (() => void)[] = [];
  readonly #users = new Set<object>();
  #text = "";
  #asking = false;

  constructor(readonly source: Source) {
    if (source.recorded) return;
    setInterval(() => this.#users.size > 0 && !document.hidden && void this.refresh(), PERIOD);
    source.listen({ onServers: () => void this.refresh(), onInfo: () => void this.#first() });
  }

  /** Calls a function after each change. */
  listen(listener: () => void): void {
    this.#listeners.push(listener);
  }

  /** Keeps the list up to date while `user` needs it. */
  use(user: object, on: boolean): void {
    if (!on) {
      this.#users.delete(user);
    } else if (!this.#users.has(user)) {
      this.#users.add(user);
      void this.refresh();
    }
  }

  async refresh(): Promise<void> {
    if (this.#asking || !this.source.state.connected) return;
    this.#asking = true;
    try {
      this.#set(await this.source.interfaces());
    } catch (error) {
      console.warn((error as Error).message);
    } finally {
      this.#asking = false;
    }
  }

  /** Returns the topics of some types that a server subscribes to. */
  commands(...types: string[]): TopicEntry[] {
    return this.topics.filter(({ type, subscribers }) => subscribers > 0 && types.includes(type));
  }

  /** A server that has just become known has topics. */
  async #first(): Promise<void> {
    if (this.topics.length === 0) await this.refresh();
  }

  #set(interfaces: Interfaces): void {
    const text = JSON.stringify(interfaces);
    if (text === this.#text) return;
    this.#text = text;
    this.topics = [...interfaces.topics].sort((a, b) => (a.name < b.name ? -1 : 1));
    this.services = interfaces.services;
    for (const listener of this.#listeners) listener();
  }
}
