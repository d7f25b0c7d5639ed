"""The topics: a channel for each, whose Zenoh subscription exists while a client of the WebSocket subscribes to it."""

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import foxglove
import zenoh
from zenoh.ext import HistoryConfig, declare_advanced_subscriber
from zenoh.handlers import Callback

from mjplug.recorder.sources import Source
from mjplug.wire.origin import origin_of

_MAX_KEPT = 256
"""Maximum number of messages of a latched topic that later clients get."""


class _Topic:
    """A topic with its channel."""

    def __init__(self, source: Source, channel: foxglove.Channel) -> None:
        self.source = source
        self.channel = channel
        self.subscribers: set[int] = set()
        self.declared: list[Any] = []
        # The messages of a latched topic by publisher.
        self.kept: dict[bytes, deque[tuple[bytes, int]]] = {}


class Topics:
    """Channels and subscriptions. Thread-safe.

    Args:
        session: The session of a client.
        context: The context of the channels.
        jumped: Called when simulated time goes back, after a restored state.
    """

    def __init__(self, session: zenoh.Session, context: foxglove.Context, jumped: Callable[[], None]) -> None:
        self._session = session
        self._context = context
        self._jumped = jumped
        self._lock = threading.Lock()
        self._topics: dict[str, _Topic] = {}
        self._by_channel: dict[int, _Topic] = {}
        self._time_ns = -1

    def add(self, source: Source) -> None:
        """Adds a topic; a second call for a topic does nothing."""
        topic = source.topic
        with self._lock:
            if topic.name in self._topics:
                return
            schema = foxglove.Schema(name=topic.type, encoding="ros2msg", data=topic.definition.encode())
            channel = foxglove.Channel(topic.name, schema=schema, message_encoding="cdr", context=self._context)
            added = self._topics[topic.name] = _Topic(source, channel)
            self._by_channel[channel.id()] = added

    def subscribe(self, client: int, channel: int) -> None:
        """Handles a client of the WebSocket that subscribes to a channel."""
        with self._lock:
            topic = self._by_channel.get(channel)
            if topic is None:
                return
            first, repeated = not topic.subscribers, []
            topic.subscribers.add(client)
            if not first:
                repeated = [kept for queue in topic.kept.values() for kept in queue]
            else:
                topic.declared = [self._declare(topic, key) for key in topic.source.keys]
        for data, log_time in repeated:
            topic.channel.log(data, log_time=log_time)

    def unsubscribe(self, client: int, channel: int) -> None:
        """Handles a client of the WebSocket that leaves a channel."""
        with self._lock:
            topic = self._by_channel.get(channel)
            if topic is None:
                return
            topic.subscribers.discard(client)
            if topic.subscribers:
                return
            declared, topic.declared = topic.declared, []
            topic.kept.clear()
        for subscriber in declared:
            subscriber.undeclare()

    def close(self) -> None:
        """Ends all subscriptions."""
        with self._lock:
            topics = [*self._topics.values()]
            self._by_channel.clear()
        for topic in topics:
            for subscriber in topic.declared:
                subscriber.undeclare()
            topic.channel.close()

    def time_of(self, sample: zenoh.Sample) -> int:
        """Returns the simulated time of a message, or that of the last one before if it has none [ns]."""
        origin = origin_of(sample.attachment)
        if origin is None or origin.time_ns is None:
            return self._time_ns if self._time_ns >= 0 else time.time_ns()
        if origin.time_ns < self._time_ns - 1_000_000_000:
            self._jumped()
        self._time_ns = origin.time_ns
        return origin.time_ns

    def _declare(self, topic: _Topic, key: str) -> Any:
        latched = topic.source.topic.latched

        def receive(sample: zenoh.Sample) -> None:
            data = sample.payload.to_bytes()
            if sample.kind != zenoh.SampleKind.PUT or data[:2] not in (b"\0\0", b"\0\1"):
                return
            if latched:
                # Its own time may be from long before; a viewer would not show it.
                log_time = max(self._time_ns, 0)
                origin = origin_of(sample.attachment)
                gid = b"" if origin is None else origin.gid
                depth = min(topic.source.topic.qos.depth, _MAX_KEPT)
                with self._lock:
                    if len(topic.kept) < _MAX_KEPT or gid in topic.kept:
                        topic.kept.setdefault(gid, deque(maxlen=depth)).append((data, log_time))
            else:
                log_time = self.time_of(sample)
            topic.channel.log(data, log_time=log_time)

        handler = Callback(receive, indirect=False)
        if not latched:
            return self._session.declare_subscriber(key, handler)
        history = HistoryConfig(detect_late_publishers=True, max_samples=topic.source.topic.qos.depth)
        return declare_advanced_subscriber(self._session, key, handler, history=history)
