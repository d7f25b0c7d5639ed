"""What a publisher writes to: a key for those who listen now, or one that late joiners can still read."""

from collections import deque
from collections.abc import Callable

import zenoh
from zenoh.ext import CacheConfig, MissDetectionConfig, declare_advanced_publisher
from zenoh.handlers import Callback

from mjplug.transport import QoS
from mjplug.wire.encoding import Form

_HEARTBEAT = 0.5
"""How soon a subscriber learns that it missed the last message of a reliable latched topic [s]; rmw_zenoh's value."""


def reliability(qos: QoS) -> zenoh.Reliability:
    """Returns Zenoh's word for it."""
    return zenoh.Reliability.RELIABLE if qos.reliability == "reliable" else zenoh.Reliability.BEST_EFFORT


class LiveOutlet:
    """A key for those who listen now. `matched` follows Zenoh's matching status.

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
    ) -> None:
        self.form = form
        self.matched = False
        self._on_matched = on_matched
        self._closed = False
        self._publisher = session.declare_publisher(
            key, encoding=encoding, congestion_control=zenoh.CongestionControl.DROP, reliability=reliability(qos)
        )
        self._put = self._publisher.put
        # Tells the present status at once if somebody matches already.
        self._listener = self._publisher.declare_matching_listener(Callback(self._changed, indirect=False))

    def put(self, payload: zenoh.ZBytes) -> None:
        """Sends an encoded message."""
        self._put(payload)

    def close(self) -> None:
        """Makes it unmatched for good."""
        self._closed = True
        self.matched = False

    def _changed(self, status: zenoh.MatchingStatus) -> None:
        appeared = status.matching and not self.matched and not self._closed
        self.matched = status.matching and not self._closed
        if appeared:
            self._on_matched()


class LatchedOutlet:
    """A key whose last messages late joiners still get, so that it is written to even if nobody listens.

    Subscribers with a history (Zenoh's advanced subscriber, rmw_zenoh, zenoh-bridge-ros2dds) get them from the
    publisher's cache. Any other client gets them with a query on the key itself.
    """

    def __init__(self, session: zenoh.Session, key: str, form: Form, encoding: zenoh.Encoding, qos: QoS) -> None:
        self.form = form
        self.matched = True
        self._key = key
        self._encoding = encoding
        self._last: deque[zenoh.ZBytes] = deque(maxlen=qos.depth)
        reliable = qos.reliability == "reliable"
        self._publisher = declare_advanced_publisher(
            session,
            key,
            encoding=encoding,
            congestion_control=zenoh.CongestionControl.DROP,
            reliability=reliability(qos),
            cache=CacheConfig(qos.depth),
            publisher_detection=True,
            sample_miss_detection=MissDetectionConfig(heartbeat=None, sporadic_heartbeat=_HEARTBEAT)
            if reliable
            else None,
        )
        self._queryable = session.declare_queryable(key, Callback(self._answer, indirect=False))

    def put(self, payload: zenoh.ZBytes) -> None:
        """Sends an encoded message and keeps it."""
        self._last.append(payload)
        self._publisher.put(payload)

    def close(self) -> None:
        """Makes it unmatched for good."""
        self.matched = False

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            for payload in tuple(self._last):
                query.reply(self._key, payload, encoding=self._encoding)
