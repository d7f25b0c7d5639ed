import type { App } from "../../app.ts";
import type { Fields, TopicEntry } from "../../wire/protocol.ts";
import type { Sample } from "../../wire/source.ts";
import { type Live, samples } from "../live.ts";
import { type Header, seconds } from "../messages.ts";
import { fieldReader, type ReadField } from "./fields.ts";
import { Series } from "./series.ts";

/** A plotted field of a topic. */
export interface Channel {
  readonly topic: string;
  readonly path: string;
  readonly series: Series;
  readonly read: ReadField;
}

interface Subscribed {
  readonly live: Live;
  readonly channels: Set<Channel>;
}

/** Fills series with the samples of topics. Each topic is subscribed to once, with all samples, while a field is plotted. */
export class Feed {
  /** Why a topic delivers nothing, by topic. */
  readonly problems = new Map<string, string>();
  /** Types by topic. */
  readonly types = new Map<string, string>();
  readonly #subscribed = new Map<string, Subscribed>();

  constructor(
    readonly app: App,
    readonly server: (topic: string) => number,
  ) {}

  open(topic: string, path: string): Channel {
    const channel: Channel = { topic, path, series: new Series(), read: fieldReader(path) };
    let subscribed = this.#subscribed.get(topic);
    if (subscribed === undefined) {
      this.problems.delete(topic);
      const receive = (received: Sample[]) => this.#receive(topic, received);
      const fail = (sentence: string) => this.problems.set(topic, sentence);
      subscribed = { live: samples(this.app.source, topic, "all", receive, fail), channels: new Set() };
      this.#subscribed.set(topic, subscribed);
    }
    subscribed.channels.add(channel);
    return channel;
  }

  close(channel: Channel): void {
    const subscribed = this.#subscribed.get(channel.topic);
    subscribed?.channels.delete(channel);
    if (subscribed === undefined || subscribed.channels.size > 0) return;
    subscribed.live.close();
    this.#subscribed.delete(channel.topic);
  }

  #receive(topic: string, received: readonly Sample[]): void {
    const subscribed = this.#subscribed.get(topic);
    if (subscribed === undefined) return;
    if (subscribed.live.type !== "") this.types.set(topic, subscribed.live.type);
    for (const { message, lost } of received) {
      const time = this.timeOf(topic, message);
      if (time === null) continue;
      for (const { series, read } of subscribed.channels) {
        const value = read(message);
        if (value !== undefined) series.add(time, value, lost);
      }
    }
  }

  /** Returns the simulated time of a message [s]: its stamp, or the time of the newest frame. */
  timeOf(topic: string, message: Fields): number | null {
    const header = message["header"] as Header | undefined;
    const stamp = header?.stamp === undefined ? 0 : seconds(header.stamp);
    if (stamp > 0) return stamp;
    const { worlds } = this.app.stage;
    const world = worlds.get(this.server(topic)) ?? (worlds.values().next().value as undefined);
    return world?.frame?.time ?? null;
  }
}

/** Returns the entry of a topic, if a server has it. */
export function entryOf(topics: readonly TopicEntry[], name: string): TopicEntry | undefined {
  return topics.find((entry) => entry.name === name);
}
