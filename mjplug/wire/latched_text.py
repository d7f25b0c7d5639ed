"""Receives one text from a latched topic: std_msgs/String of ROS 2 nodes or of Zenoh clients, or the text itself."""

import contextlib
import queue
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import zenoh
from zenoh.ext import HistoryConfig, declare_advanced_subscriber

from mjplug.errors import MjplugError, WireError
from mjplug.wire.callbacks import callback
from mjplug.wire.encoding import Decoder, Limits, PayloadError, Received
from mjplug.wire.plain import key_of
from mjplug.wire.rmw_zenoh.keys import RosSettings, definition_mismatch
from mjplug_schemas.std_msgs import String

_QUERY_PERIOD = 1.0
"""Interval between two queries for the text, from publishers that only answer queries, such as storages [s]."""

_REPORT_PERIOD = 10.0
"""Interval between two lines about the wait [s]."""

_MAX_WAITING = 16
"""Number of received messages that wait to be decoded; further ones are dropped."""

_UTF8_BOM = b"\xef\xbb\xbf"

Tell = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class TextTopic:
    """A topic with a text.

    Attributes:
        name: Its full name.
        ros2: Settings of the ROS 2 nodes that may publish it; None for Zenoh clients only.
        limit: Largest size of a message [bytes].
    """

    name: str
    ros2: RosSettings | None
    limit: int

    @property
    def keys(self) -> tuple[str, ...]:
        """The Zenoh keys: the plain key, and that of rmw_zenoh."""
        ros = () if self.ros2 is None else (self.ros2.any_hash_key(self.name, String),)
        return (key_of(self.name), *ros)


class NoTextError(WireError):
    """No text arrived in time."""


def receive_text(
    session: zenoh.Session,
    topic: TextTopic,
    timeout: float,
    tell: Tell,
    check: Callable[[str], None] = lambda text: None,
) -> str:
    """Returns the first text on a topic that is not empty.

    Messages that were published before are received too, if the publisher is latched: from the caches of Zenoh's
    advanced publishers, which rmw_zenoh uses for transient local topics, and from queryables.

    Args:
        session: The session.
        topic: The topic.
        timeout: How long to wait [s].
        tell: Gets a line about the wait at its beginning and every 10 s, and about each kind of message that is not
            used.
        check: Raises an `MjplugError` if a text cannot be used; then the wait continues.

    Raises:
        NoTextError: No text arrived in time.
    """
    samples: queue.Queue[zenoh.Sample] = queue.Queue(_MAX_WAITING)

    def receive(sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.PUT:
            with contextlib.suppress(queue.Full):
                samples.put_nowait(sample)

    def receive_reply(reply: zenoh.Reply) -> None:
        if reply.ok is not None:
            receive(reply.ok)

    history = HistoryConfig(detect_late_publishers=True, max_samples=1)
    subscribers: list[Any] = [
        declare_advanced_subscriber(session, key, callback(receive), history=history) for key in topic.keys
    ]
    begin = time.monotonic()
    end, next_query, next_report = begin + timeout, begin, begin
    refusals: dict[str, None] = {}
    keys = " and ".join(topic.keys)
    try:
        while True:
            now = time.monotonic()
            if now >= end:
                raise NoTextError(_timeout_sentence(session, topic, timeout, keys, list(refusals)))
            if now >= next_report:
                left = f"{end - now:.0f} s left"
                tell(f"waiting for a message on {topic.name} (Zenoh keys {keys}), {_neighbours(session)}; {left}")
                next_report += _REPORT_PERIOD
            if now >= next_query:
                for key in topic.keys:
                    session.get(key, callback(receive_reply), timeout=_QUERY_PERIOD)
                next_query = now + _QUERY_PERIOD
            try:
                sample = samples.get(timeout=max(0.0, min(end, next_query, next_report) - now))
            except queue.Empty:
                continue
            try:
                text = _text(sample, topic)
                check(text)
            except MjplugError as error:
                reason = f"a message on the key {sample.key_expr} is not used: {error}"
                if reason not in refusals and len(refusals) < _MAX_WAITING:
                    refusals[reason] = None
                    tell(reason)
                continue
            return text
    finally:
        for subscriber in subscribers:
            subscriber.undeclare()


def _text(sample: zenoh.Sample, topic: TextTopic) -> str:
    """Returns the text in a message.

    Raises:
        PayloadError: It contains no text, or is too large.
    """
    size = len(sample.payload)
    if size > topic.limit:
        raise PayloadError(f"it has {size} bytes; at most {topic.limit} are accepted (zenoh.max_payload_bytes)")
    raw = sample.payload.to_bytes()
    key = str(sample.key_expr)
    if raw.removeprefix(_UTF8_BOM).lstrip()[:1] == b"<":
        try:
            return raw.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise PayloadError(f"it is not UTF-8: {error}") from error
    from_ros = key != key_of(topic.name)
    mismatch = definition_mismatch(key, String) if from_ros else ""
    received = Received(sample.payload, sample.encoding, "cdr" if from_ros else None, mismatch)
    text = Decoder(String, Limits(topic.limit, topic.limit)).decode(received)[1].data
    if not text.strip():
        raise PayloadError("it is empty")
    return text


def _neighbours(session: zenoh.Session) -> str:
    """Returns how many other Zenoh sessions this one is connected to."""
    counts = [
        f"{len(found)} {kind}{'' if len(found) == 1 else 's'}"
        for kind, found in (("router", session.info.routers_zid()), ("peer or client", session.info.peers_zid()))
        if found
    ]
    return f"connected to {' and '.join(counts)}" if counts else "not connected to any other Zenoh session yet"


def _timeout_sentence(session: zenoh.Session, topic: TextTopic, timeout: float, keys: str, refusals: list[str]) -> str:
    reasons = f"; {'; '.join(refusals)}" if refusals else ""
    return (
        f"no usable message on {topic.name} within {timeout:g} s (Zenoh keys {keys}), {_neighbours(session)}{reasons}; "
        "start its publisher, such as robot_state_publisher, or check the name and the endpoints"
    )
