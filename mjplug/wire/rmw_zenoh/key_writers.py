"""The Zenoh publishers of a key for ROS 2 nodes: the payload is that of the plain key, with an attachment.

The encoding is not set, as in rmw_zenoh, because the key contains the type.
"""

from collections.abc import Callable
from dataclasses import dataclass

import zenoh
from zenoh.ext import CacheConfig, MissDetectionConfig, declare_advanced_publisher

from mjplug.contracts.transport import QoS
from mjplug.wire.dialect import RemoteWriterSpec
from mjplug.wire.encoding import Form
from mjplug.wire.key_writers import WORKER_PRIORITY, LiveWriter
from mjplug.wire.origin import Now
from mjplug.wire.rmw_zenoh.attachment import Attachments

_HEARTBEAT_PERIOD = 0.5
"""Heartbeat period by which a subscription detects that it missed the last message of a reliable latched topic [s]."""


class LiveRmwWriter(LiveWriter):
    """A publisher for current subscriptions of nodes."""

    def __init__(
        self,
        session: zenoh.Session,
        key: str,
        gid: bytes,
        qos: QoS,
        on_matched: Callable[[], None],
        priority: zenoh.Priority = zenoh.Priority.DATA,
    ) -> None:
        self._rmw_attachments = Attachments(gid)
        self._rmw_remote_spec = LiveRmwWriterSpec(key, gid, qos)
        super().__init__(session, key, "cdr", zenoh.Encoding.ZENOH_BYTES, qos, on_matched, priority=priority)

    def put(self, payload: zenoh.ZBytes) -> None:
        """Sends an encoded message."""
        self._put(payload, attachment=self._rmw_attachments.next())

    def remote_spec(self) -> RemoteWriterSpec:
        """Returns the data with which another process can write to the key, with the gid of the server's token."""
        return self._rmw_remote_spec


@dataclass(frozen=True, slots=True)
class LiveRmwWriterSpec:
    """The arguments of a `LiveRmwWriter`; picklable."""

    key: str
    gid: bytes
    qos: QoS

    def open(self, session: zenoh.Session, on_matched: Callable[[], None], now: Now) -> LiveRmwWriter:
        """Declares the writer. Attachments of rmw_zenoh contain no simulated time."""
        return LiveRmwWriter(session, self.key, self.gid, self.qos, on_matched, WORKER_PRIORITY)


class LatchedRmwWriter:
    """A publisher whose last messages late subscriptions get, with the original attachments."""

    def __init__(self, session: zenoh.Session, key: str, gid: bytes, qos: QoS) -> None:
        self.form: Form = "cdr"
        self.matched = True
        self._remote_spec = LatchedRmwWriterSpec(key, gid, qos)
        self._attachments = Attachments(gid)
        reliable = qos.reliability == "reliable"
        self._publisher = declare_advanced_publisher(
            session,
            key,
            congestion_control=zenoh.CongestionControl.DROP,
            reliability=zenoh.Reliability.RELIABLE,
            cache=CacheConfig(qos.depth),
            publisher_detection=True,
            sample_miss_detection=MissDetectionConfig(heartbeat=None, sporadic_heartbeat=_HEARTBEAT_PERIOD)
            if reliable
            else None,
        )

    def put(self, payload: zenoh.ZBytes) -> None:
        """Sends an encoded message and keeps it."""
        self._publisher.put(payload, attachment=self._attachments.next())

    def refresh_matched(self) -> None:
        """Does nothing; the writer is always matched."""

    def refresh(self, key: str) -> bool:
        """Returns False; the writer is always matched, and late subscriptions miss no message."""
        return False

    def remote_spec(self) -> RemoteWriterSpec:
        """Returns the data with which another process can write to the key, with the gid of the server's token."""
        return self._remote_spec

    def close(self) -> None:
        """Makes the writer unmatched permanently."""
        self.matched = False


@dataclass(frozen=True, slots=True)
class LatchedRmwWriterSpec:
    """The arguments of a `LatchedRmwWriter`; picklable."""

    key: str
    gid: bytes
    qos: QoS

    def open(self, session: zenoh.Session, on_matched: Callable[[], None], now: Now) -> LatchedRmwWriter:
        """Declares the writer; it is matched from the start, so `on_matched` is not called."""
        return LatchedRmwWriter(session, self.key, self.gid, self.qos)
