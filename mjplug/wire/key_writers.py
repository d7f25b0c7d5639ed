"""What a publisher writes to: a key for those who listen now, or one that late joiners can still read.

All of them are reliable to Zenoh, the best-effort topics of ROS too, since Zenoh before 1.6 throws away what is best
effort and comes in one batch with something reliable. A slow listener costs messages in either case: congestion drops.
"""

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import zenoh
from zenoh.ext import CacheConfig, MissDetectionConfig, declare_advanced_publisher

from mjplug.contracts.transport import QoS
from mjplug.wire.callbacks import callback
from mjplug.wire.dialect import RemoteWriterSpec
from mjplug.wire.encoding import Form

WORKER_PRIORITY = zenoh.Priority.DATA_LOW
"""Of what a worker process publishes, which is large: it has a queue of its own in each link. In one with the rest, a
link that is full of images makes a put of the server wait for up to 50 ms, and loses what is small.
"""

_HEARTBEAT = 0.5
"""How soon a subscriber learns that it missed the last message of a reliable latched topic [s]; rmw_zenoh's value."""


class LiveWriter:
    """A key for those who listen now. `matched` follows Zenoh's matching status; `refresh` brings it up to date.

    Congestion drops, as in rmw_zenoh: a slow listener must not hold up physics. Express is left off: it gains nothing
    for paced messages and costs several microseconds in bursts.
    """

    def __init__(
        self,
        session: zenoh.Session,
        key: str,
        form: Form,
        encoding: zenoh.Encoding,
        qos: QoS,
        on_matched: Callable[[], None],
        priority: zenoh.Priority = zenoh.Priority.DATA,
    ) -> None:
        self.form = form
        self.matched = False
        self._remote_spec = LiveWriterSpec(key, form, str(encoding), qos)
        self._on_matched = on_matched
        self._closed = False
        self._lock = threading.Lock()
        self._key = key
        self._publisher = session.declare_publisher(
            key,
            encoding=encoding,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=priority,
            reliability=zenoh.Reliability.RELIABLE,
        )
        self._put = self._publisher.put
        # Tells the present status at once if somebody matches already.
        self._listener = self._publisher.declare_matching_listener(callback(self._changed))

    def put(self, payload: zenoh.ZBytes) -> None:
        """Sends an encoded message."""
        self._put(payload)

    def remote_spec(self) -> RemoteWriterSpec:
        """Returns what another process needs to write to the key."""
        return self._remote_spec

    def look(self) -> None:
        """Brings `matched` up to date."""
        self.refresh(self._key)

    def refresh(self, key: str) -> bool:
        """Brings `matched` up to date if this is the writer's key; returns whether it is, with a subscriber.

        Zenoh reports a new subscriber on a thread of its own, on a busy machine after the next request of the same
        client has been delivered.
        """
        if key != self._key:
            return False
        with self._lock:
            before = self.matched
            # zenoh's stubs take the status for a bool.
            status: Any = self._publisher.matching_status
            self.matched = status.matching and not self._closed
            if self.matched and not before:
                # Under the lock, so that nobody returns from here before it has been called.
                self._on_matched()
            return self.matched

    def close(self) -> None:
        """Makes it unmatched for good."""
        with self._lock:
            self._closed = True
            self.matched = False

    def _changed(self, status: zenoh.MatchingStatus) -> None:
        # Not `status`, which is older than what `refresh` may have found meanwhile.
        self.refresh(self._key)


@dataclass(frozen=True, slots=True)
class LiveWriterSpec:
    """A `LiveWriter` to be; see there."""

    key: str
    form: Form
    encoding: str
    qos: QoS

    def open(self, session: zenoh.Session, on_matched: Callable[[], None]) -> LiveWriter:
        """Declares the writer."""
        encoding = zenoh.Encoding(self.encoding)
        return LiveWriter(session, self.key, self.form, encoding, self.qos, on_matched, WORKER_PRIORITY)


class LatchedWriter:
    """A key whose last messages late joiners still get, so that it is written to even if nobody listens.

    Subscribers with a history (Zenoh's advanced subscriber, rmw_zenoh, zenoh-bridge-ros2dds) get them from the
    publisher's cache. Any other client gets them with a query on the key itself.
    """

    def __init__(self, session: zenoh.Session, key: str, form: Form, encoding: zenoh.Encoding, qos: QoS) -> None:
        self.form = form
        self.matched = True
        self._remote_spec = LatchedWriterSpec(key, form, str(encoding), qos)
        self._key = key
        self._encoding = encoding
        self._last: deque[zenoh.ZBytes] = deque(maxlen=qos.depth)
        reliable = qos.reliability == "reliable"
        self._publisher = declare_advanced_publisher(
            session,
            key,
            encoding=encoding,
            congestion_control=zenoh.CongestionControl.DROP,
            reliability=zenoh.Reliability.RELIABLE,
            cache=CacheConfig(qos.depth),
            publisher_detection=True,
            sample_miss_detection=MissDetectionConfig(heartbeat=None, sporadic_heartbeat=_HEARTBEAT)
            if reliable
            else None,
        )
        self._queryable = session.declare_queryable(key, callback(self._answer))

    def put(self, payload: zenoh.ZBytes) -> None:
        """Sends an encoded message and keeps it."""
        self._last.append(payload)
        self._publisher.put(payload)

    def remote_spec(self) -> RemoteWriterSpec:
        """Returns what another process needs to write to the key."""
        return self._remote_spec

    def look(self) -> None:
        """Does nothing: it is always matched."""

    def refresh(self, key: str) -> bool:
        """Returns false: it is always matched, and late subscribers miss nothing."""
        return False

    def close(self) -> None:
        """Makes it unmatched for good."""
        self.matched = False

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            for payload in tuple(self._last):
                query.reply(self._key, payload, encoding=self._encoding)


@dataclass(frozen=True, slots=True)
class LatchedWriterSpec:
    """A `LatchedWriter` to be; see there."""

    key: str
    form: Form
    encoding: str
    qos: QoS

    def open(self, session: zenoh.Session, on_matched: Callable[[], None]) -> LatchedWriter:
        """Declares the writer; it is matched from the beginning."""
        return LatchedWriter(session, self.key, self.form, zenoh.Encoding(self.encoding), self.qos)
