"""What a publisher writes to for ROS 2 nodes: the payload is that of the plain key, the attachment is their own.

The encoding is not said, as nodes do not say it either: the key names the type.
"""

from collections.abc import Callable
from dataclasses import dataclass

import zenoh
from zenoh.ext import CacheConfig, MissDetectionConfig, declare_advanced_publisher

from mjplug.contracts.transport import QoS
from mjplug.wire.dialect import RemoteWriterSpec
from mjplug.wire.encoding import Form
from mjplug.wire.key_writers import WORKER_PRIORITY, LiveWriter
from mjplug.wire.rmw_zenoh.attachment import Attachments

_HEARTBEAT = 0.5
"""How soon a subscription learns that it missed the last message of a reliable latched topic [s]."""


class LiveRmwWriter(LiveWriter):
    """A key for the nodes that listen now."""

    def __init__(
        self,
        session: zenoh.Session,
        key: str,
        gid: bytes,
        qos: QoS,
        on_matched: Callable[[], None],
        priority: zenoh.Priority = zenoh.Priority.DATA,
    ) -> None:
        self._attachments = Attachments(gid)
        self._rmw_remote_spec = LiveRmwWriterSpec(key, gid, qos)
        super().__init__(session, key, "cdr", zenoh.Encoding.ZENOH_BYTES, qos, on_matched, priority)

    def put(self, payload: zenoh.ZBytes) -> None:
        """Sends an encoded message."""
        self._put(payload, attachment=self._attachments.next())

    def remote_spec(self) -> RemoteWriterSpec:
        """Returns what another process needs to write to the key; the gid stays that of the server's token."""
        return self._rmw_remote_spec


@dataclass(frozen=True, slots=True)
class LiveRmwWriterSpec:
    """A `LiveRmwWriter` to be; see there."""

    key: str
    gid: bytes
    qos: QoS

    def open(self, session: zenoh.Session, on_matched: Callable[[], None]) -> LiveRmwWriter:
        """Declares the writer."""
        return LiveRmwWriter(session, self.key, self.gid, self.qos, on_matched, WORKER_PRIORITY)


class LatchedRmwWriter:
    """A key whose last messages a late node still gets, with the attachments that they had."""

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
            sample_miss_detection=MissDetectionConfig(heartbeat=None, sporadic_heartbeat=_HEARTBEAT)
            if reliable
            else None,
        )

    def put(self, payload: zenoh.ZBytes) -> None:
        """Sends an encoded message and keeps it."""
        self._publisher.put(payload, attachment=self._attachments.next())

    def look(self) -> None:
        """Does nothing: it is always matched."""

    def refresh(self, key: str) -> bool:
        """Returns false: it is always matched, and late nodes miss nothing."""
        return False

    def remote_spec(self) -> RemoteWriterSpec:
        """Returns what another process needs to write to the key; the gid stays that of the server's token."""
        return self._remote_spec

    def close(self) -> None:
        """Makes it unmatched for good."""
        self.matched = False


@dataclass(frozen=True, slots=True)
class LatchedRmwWriterSpec:
    """A `LatchedRmwWriter` to be; see there."""

    key: str
    gid: bytes
    qos: QoS

    def open(self, session: zenoh.Session, on_matched: Callable[[], None]) -> LatchedRmwWriter:
        """Declares the writer; it is matched from the beginning."""
        return LatchedRmwWriter(session, self.key, self.gid, self.qos)
