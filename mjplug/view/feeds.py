"""One Zenoh subscription per key, shared by all pages that need it."""

import threading
from collections import deque
from collections.abc import Sequence
from typing import Any, Protocol

import zenoh
from zenoh.ext import HistoryConfig, declare_advanced_subscriber
from zenoh.handlers import Callback

from mjplug.view.handoff import Handoff

MAX_SAMPLES = 1000
"""Maximum number of samples of a key that wait for the event loop; the oldest are dropped."""

MAX_BYTES = 32 << 20
"""Maximum total size of these samples [bytes]; one sample is always kept."""


class Listener(Protocol):
    """Receives the samples of a feed, on the event loop."""

    @property
    def wants_all(self) -> bool:
        """Whether it needs every sample; otherwise only the newest is delivered."""

    def receive(self, payloads: Sequence[bytes], lost: int) -> None:
        """Takes samples.

        Args:
            payloads: The payloads of the samples, in order; at least one.
            lost: Number of samples that were dropped before the first of them.
        """


class Feed:
    """The samples of one key.

    Zenoh's thread only stores each sample; the event loop takes all that wait at once.

    Args:
        session: The session.
        key: The key.
        history: How many earlier samples to request, of each publisher; 0 for a topic that is not latched.
        handoff: Calls functions on the event loop.
    """

    def __init__(self, session: zenoh.Session, key: str, history: int, handoff: Handoff) -> None:
        self._handoff = handoff
        self._listeners: list[Listener] = []
        self._wants_all = False
        self._lock = threading.Lock()
        self._waiting: deque[zenoh.Sample] = deque()
        self._bytes = 0
        self._lost = 0
        self._posted = False
        # The last samples of a latched topic, for pages that join later.
        self._kept: deque[bytes] = deque(maxlen=history) if history else deque(maxlen=0)
        handler = Callback(self._arrived, indirect=False)
        self._declared: Any
        if history:
            self._declared = declare_advanced_subscriber(
                session, key, handler, history=HistoryConfig(detect_late_publishers=True, max_samples=history)
            )
        else:
            self._declared = session.declare_subscriber(key, handler)

    @property
    def used(self) -> bool:
        """Whether it has listeners."""
        return bool(self._listeners)

    def add(self, listener: Listener) -> None:
        """Adds a listener; it gets the last samples of a latched topic at once."""
        self._listeners.append(listener)
        self._wants_all = any(each.wants_all for each in self._listeners)
        if self._kept:
            listener.receive(tuple(self._kept), 0)

    def remove(self, listener: Listener) -> None:
        """Removes a listener."""
        self._listeners.remove(listener)
        self._wants_all = any(each.wants_all for each in self._listeners)

    def close(self) -> None:
        """Undeclares the subscription."""
        self._declared.undeclare()

    def _arrived(self, sample: zenoh.Sample) -> None:
        """Stores a sample. Zenoh's thread."""
        if sample.kind != zenoh.SampleKind.PUT:
            return
        size = len(sample.payload)
        with self._lock:
            limit = MAX_SAMPLES if self._wants_all or self._kept.maxlen else 1
            self._waiting.append(sample)
            self._bytes += size
            while len(self._waiting) > limit or (self._bytes > MAX_BYTES and len(self._waiting) > 1):
                self._bytes -= len(self._waiting.popleft().payload)
                self._lost += 1
            posted, self._posted = self._posted, True
        if not posted:
            self._handoff.post(self._deliver)

    def _deliver(self) -> None:
        with self._lock:
            samples, self._waiting, self._bytes = self._waiting, deque(), 0
            lost, self._lost = self._lost, 0
            self._posted = False
        payloads = [bytes(sample.payload) for sample in samples]
        self._kept.extend(payloads)
        for listener in tuple(self._listeners):
            if listener.wants_all:
                listener.receive(payloads, lost)
            else:
                listener.receive(payloads[-1:], lost + len(payloads) - 1)


class Feeds:
    """The feeds of a network, by key: a feed exists as long as it has listeners.

    Args:
        session: The session.
        handoff: Calls functions on the event loop.
    """

    def __init__(self, session: zenoh.Session, handoff: Handoff) -> None:
        self._session = session
        self._handoff = handoff
        self._feeds: dict[str, Feed] = {}

    @property
    def keys(self) -> list[str]:
        """The keys that are subscribed to."""
        return list(self._feeds)

    def add(self, key: str, listener: Listener, history: int = 0) -> None:
        """Delivers the samples of a key to a listener.

        Args:
            key: The key.
            listener: The listener.
            history: As for `Feed`; that of the first listener holds.
        """
        feed = self._feeds.get(key)
        if feed is None:
            feed = self._feeds[key] = Feed(self._session, key, history, self._handoff)
        feed.add(listener)

    def remove(self, key: str, listener: Listener) -> None:
        """Ends what `add` began; without listeners, the subscription is undeclared."""
        feed = self._feeds[key]
        feed.remove(listener)
        if not feed.used:
            del self._feeds[key]
            feed.close()

    def close(self) -> None:
        """Undeclares all subscriptions."""
        for feed in self._feeds.values():
            feed.close()
        self._feeds.clear()
