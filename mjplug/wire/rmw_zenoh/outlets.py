"""What a publisher writes to for ROS 2 nodes: the payload is that of the plain key, the attachment is their own.

The encoding is not said, as nodes do not say it either: the key names the type.
"""

from collections.abc import Callable

import zenoh
from zenoh.ext import CacheConfig, MissDetectionConfig, declare_advanced_publisher

from mjplug.transport import QoS
from mjplug.wire.encoding import Form
from mjplug.wire.outlets import LiveOutlet, reliability
from mjplug.wire.rmw_zenoh.attachment import Attachments

_HEARTBEAT = 0.5
"""How soon a subscription learns that it missed the last message of a reliable latched topic [s]."""


class LiveRmwOutlet(LiveOutlet):
    """A key for the nodes that listen now."""

    def __init__(self, session: zenoh.Session, key: str, gid: bytes, qos: QoS, on_matched: Callable[[], None]) -> None:
        self._attachments = Attachments(gid)
        super().__init__(session, key, "cdr", zenoh.Encoding.ZENOH_BYTES, qos, on_matched)

    def put(self, payload: zenoh.ZBytes) -> None:
        """Sends an encoded message."""
        self._put(payload, attachment=self._attachments.next())


class LatchedRmwOutlet:
    """A key whose last messages a late node still gets, with the attachments that they had."""

    def __init__(self, session: zenoh.Session, key: str, gid: bytes, qos: QoS) -> None:
        self.form: Form = "cdr"
        self.matched = True
        self._attachments = Attachments(gid)
        reliable = qos.reliability == "reliable"
        self._publisher = declare_advanced_publisher(
            session,
            key,
            congestion_control=zenoh.CongestionControl.DROP,
            reliability=reliability(qos),
            cache=CacheConfig(qos.depth),
            publisher_detection=True,
            sample_miss_detection=MissDetectionConfig(heartbeat=None, sporadic_heartbeat=_HEARTBEAT)
            if reliable
            else None,
        )

    def put(self, payload: zenoh.ZBytes) -> None:
        """Sends an encoded message and keeps it."""
        self._publisher.put(payload, attachment=self._attachments.next())

    def close(self) -> None:
        """Makes it unmatched for good."""
        self.matched = False
