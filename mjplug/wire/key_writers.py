"""The Zenoh publishers of a key: for current subscribers only, or also for late subscribers (latched).

All publishers are reliable in Zenoh, also those of best-effort ROS topics, because Zenoh before 1.6 drops a best-effort
message that is in one batch with a reliable one. In either case, messages to a slow subscriber are dropped
(congestion control DROP).
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
from mjplug.wire.encoding import Form, WrittenForm
from mjplug.wire.origin import Attachments, Now

WORKER_PRIORITY = zenoh.Priority.DATA_LOW
"""Zenoh priority of publications of worker processes, which are large. Each priority has its own queue in a link. In a
common queue, images that fill a link would delay a put of the server by up to 50 ms and displace small messages.
"""

_HEARTBEAT_PERIOD = 0.5
"""Heartbeat period by which a subscriber detects that it missed the last message of a reliable latched topic [s]; the
value of rmw_zenoh."""


class LiveWriter:
    """A publisher for current subscribers. `matched` follows Zenoh's matching status; `refresh` updates it at once.

    Congestion control is DROP, as in rmw_zenoh, so that a slow subscriber does not delay physics. Express mode is off:
    it has no advantage for paced messages and costs several microseconds in bursts.
    """

    def __init__(
        self,
        session: zenoh.Session,
        key: str,
        form: WrittenForm,
        encoding: zenoh.Encoding,
        qos: QoS,
        on_matched: Callable[[], None],
        attachments: Attachments | None = None,
        priority: zenoh.Priority = zenoh.Priority.DATA,
    ) -> None:
        self.form = form
        self.matched = False
        host = None if attachments is None else attachments.host
        self._remote_spec = LiveWriterSpec(key, form, str(encoding), qos, host)
        self._attachments = attachments
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
        # The listener reports the current status at once if there already is a subscriber.
        self._listener = self._publisher.declare_matching_listener(callback(self._changed))

    def put(self, payload: zenoh.ZBytes) -> None:
        """Sends an encoded message."""
        if self._attachments is None:
            self._put(payload)
        else:
            self._put(payload, attachment=self._attachments.next())

    def remote_spec(self) -> RemoteWriterSpec:
        """Returns the data with which another process can write to the key."""
        return self._remote_spec

    def refresh_matched(self) -> None:
        """Updates `matched` at once."""
        self.refresh(self._key)

    def refresh(self, key: str) -> bool:
        """Updates `matched` if `key` is the writer's key; returns whether it is, and has a subscriber.

        Zenoh reports a new subscriber on a separate thread, on a busy machine only after the next request of the same
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
                # Under the lock, so that no thread returns from here before `on_matched` has been called.
                self._on_matched()
            return self.matched

    def close(self) -> None:
        """Makes the writer unmatched permanently."""
        with self._lock:
            self._closed = True
            self.matched = False

    def _changed(self, status: zenoh.MatchingStatus) -> None:
        # `refresh` reads the status again, because `status` may be older than the last one read there.
        self.refresh(self._key)


@dataclass(frozen=True, slots=True)
class LiveWriterSpec:
    """The arguments of a `LiveWriter`; picklable.

    Attributes:
        key: The key.
        form: The form of the payloads.
        encoding: The Zenoh encoding.
        qos: The quality of service.
        host: First half of the gid in the attachments; None for a writer without attachments.
    """

    key: str
    form: WrittenForm
    encoding: str
    qos: QoS
    host: bytes | None

    def open(self, session: zenoh.Session, on_matched: Callable[[], None], now: Now) -> LiveWriter:
        """Declares the writer."""
        encoding = zenoh.Encoding(self.encoding)
        attachments = None if self.host is None else Attachments(self.host, now)
        return LiveWriter(session, self.key, self.form, encoding, self.qos, on_matched, attachments, WORKER_PRIORITY)


class LatchedWriter:
    """A publisher whose last messages late subscribers get. It publishes even without subscribers.

    Subscribers with history (Zenoh's advanced subscriber, rmw_zenoh, zenoh-bridge-ros2dds) get the last messages from
    the publisher's cache. Any other client gets them by a query on the key.
    """

    def __init__(
        self,
        session: zenoh.Session,
        key: str,
        form: Form,
        encoding: zenoh.Encoding,
        qos: QoS,
        attachments: Attachments,
    ) -> None:
        self.form = form
        self.matched = True
        self._remote_spec = LatchedWriterSpec(key, form, str(encoding), qos, attachments.host)
        self._key = key
        self._encoding = encoding
        self._attachments = attachments
        self._last: deque[tuple[zenoh.ZBytes, bytes]] = deque(maxlen=qos.depth)
        reliable = qos.reliability == "reliable"
        self._publisher = declare_advanced_publisher(
            session,
            key,
            encoding=encoding,
            congestion_control=zenoh.CongestionControl.DROP,
            reliability=zenoh.Reliability.RELIABLE,
            cache=CacheConfig(qos.depth),
            publisher_detection=True,
            sample_miss_detection=MissDetectionConfig(heartbeat=None, sporadic_heartbeat=_HEARTBEAT_PERIOD)
            if reliable
            else None,
        )
        self._queryable = session.declare_queryable(key, callback(self._answer))

    def put(self, payload: zenoh.ZBytes) -> None:
        """Sends an encoded message and keeps it."""
        attachment = self._attachments.next()
        self._last.append((payload, attachment))
        self._publisher.put(payload, attachment=attachment)

    def remote_spec(self) -> RemoteWriterSpec:
        """Returns the data with which another process can write to the key."""
        return self._remote_spec

    def refresh_matched(self) -> None:
        """Does nothing; the writer is always matched."""

    def refresh(self, key: str) -> bool:
        """Returns False; the writer is always matched, and late subscribers miss no message."""
        return False

    def close(self) -> None:
        """Makes the writer unmatched permanently."""
        self.matched = False

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            for payload, attachment in tuple(self._last):
                query.reply(self._key, payload, encoding=self._encoding, attachment=attachment)


@dataclass(frozen=True, slots=True)
class LatchedWriterSpec:
    """The arguments of a `LatchedWriter`; picklable. `host` is the first half of the gid in the attachments."""

    key: str
    form: Form
    encoding: str
    qos: QoS
    host: bytes

    def open(self, session: zenoh.Session, on_matched: Callable[[], None], now: Now) -> LatchedWriter:
        """Declares the writer; it is matched from the start, so `on_matched` is not called."""
        encoding, attachments = zenoh.Encoding(self.encoding), Attachments(self.host, now)
        return LatchedWriter(session, self.key, self.form, encoding, self.qos, attachments)
