"""Subscriptions of the client: as an iterator, by a callback, or only the newest message."""

import json
import logging
import threading
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from time import time_ns
from typing import Any, Generic, TypeVar

import zenoh
from zenoh.ext import HistoryConfig, declare_advanced_subscriber
from zenoh.handlers import Callback

from mjplug.client.errors import ClientError, TimedOutError, WrongTypeError
from mjplug.client.timeouts import bounded
from mjplug.wakeup import Wakeup
from mjplug.wire.encoding import Decoder, Limits, PayloadError, Received
from mjplug.wire.origin import Gaps, Origin, origin_of

_log = logging.getLogger(__name__)

M = TypeVar("M")

_LARGEST = 1 << 30
"""Zenoh's limit for a message [bytes]; the lower limit of the server is for incoming messages only."""


@dataclass(frozen=True, slots=True)
class MessageInfo:
    """When a message was sent and received, and by which publisher.

    Attributes:
        received_timestamp: Wall time at which it arrived [ns since 1970].
        origin: Its sequence number, wall time and simulated time of sending, epoch, and the gid of its publisher; None
            if the publisher does not send them.
        lost: Number of messages of the same publisher that were lost between the one before and this one.
    """

    received_timestamp: int
    origin: Origin | None
    lost: int

    @property
    def age(self) -> float | None:
        """Wall time between sending and arrival [s]; None if unknown. Clocks of two machines may differ."""
        return None if self.origin is None else (self.received_timestamp - self.origin.source_timestamp) / 1e9


@dataclass(frozen=True, slots=True, eq=False)
class _Arrival:
    sample: zenoh.Sample
    info: MessageInfo


class Subscription(Generic[M]):
    """The messages of one topic. Thread-safe.

    Iteration yields each message as it arrives, and ends when the subscription is closed:

        for clock in client.subscribe("/clock"):
            ...

    Zenoh's thread only puts payloads into a queue; the reader's thread decodes them. If the reader is slower than the
    topic, the oldest messages are dropped. Ctrl-C may end a wait at any point; the subscription remains usable.

    Attributes:
        name: The topic's full name.
        type: The message class; `dict` for nested dictionaries, `bytes` for CDR data.
        dropped: Number of messages that arrived, but were dropped before they were read.
        info: When the last message that was read was sent and received, and by which publisher; None before the first.

    Args:
        name: As above.
        type: As above.
        depth: Maximum number of messages that wait to be taken; 1 keeps only the newest.
        callback: Called with each message, on its own thread; do not iterate in this case.
    """

    def __init__(self, name: str, type: type[M], depth: int, callback: Callable[[M], None] | None = None) -> None:
        self.name = name
        self.type = type
        self.dropped = 0
        self.info: MessageInfo | None = None
        self._gaps = Gaps()
        self._decode = _decoder(type)
        if depth < 1:
            raise ClientError(f"depth is {depth}; it must be at least 1, the number of messages that can wait")
        self._depth = depth
        self._queue: deque[_Arrival] = deque()
        self._newest: _Arrival | None = None
        self._decoded: tuple[_Arrival, M] | None = None
        self._changed = Wakeup()
        # Only for Zenoh's threads. Readers take no lock, because Ctrl-C could leave it locked.
        self._receiving = threading.Lock()
        self._closed = False
        # The subscriber of Zenoh; `close` takes it out of the list, which is atomic.
        self._declared: list[Any] = []
        self._thread: threading.Thread | None = None
        if callback is not None:
            # A daemon, so that a program that does not close the subscription can still exit.
            self._thread = threading.Thread(target=self._run, args=(callback,), name=f"mjplug{name}", daemon=True)

    @property
    def closed(self) -> bool:
        """Whether it has been closed."""
        return self._closed

    @property
    def lost(self) -> int:
        """Number of messages that were sent but did not arrive, by the gaps in their sequence numbers."""
        return self._gaps.lost

    def __iter__(self) -> Iterator[M]:
        """Yields each message until the subscription is closed."""
        while (arrival := self._take(None)) is not None:
            yield self._message(arrival)

    def next(self, timeout: float | None = None) -> M:
        """Returns the oldest message that has not been taken yet.

        Args:
            timeout: How long to wait [s]; None for no limit.

        Raises:
            TimedOutError: No message arrived in time.
            ClientError: The subscription is closed.
            WrongTypeError: The payload does not match the topic's type.
        """
        arrival = self._take(timeout)
        if arrival is None:
            raise ClientError(f"the subscription to {self.name} is closed")
        return self._message(arrival)

    def latest(self, timeout: float | None = 0.0) -> M | None:
        """Returns the newest message, whether it has been taken or not; None if there has been none.

        Args:
            timeout: How long to wait for a first message [s]; None for no limit.

        Raises:
            WrongTypeError: The payload does not match the topic's type.
        """
        self._changed.wait_for(
            lambda: self._newest is not None or self._closed, None if timeout is None else bounded(timeout)
        )
        arrival, decoded = self._newest, self._decoded
        if arrival is None:
            return None
        if decoded is None or decoded[0] is not arrival:
            decoded = self._decoded = (arrival, self._message(arrival))
        return decoded[1]

    def close(self) -> None:
        """Closes the subscription and ends all waits for its messages; a second call does nothing."""
        self._closed = True
        self._changed.notify()
        try:
            declared = self._declared.pop()
        except IndexError:
            # Another call has closed it, or it was never opened.
            pass
        else:
            declared.undeclare()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(1.0)

    def __enter__(self) -> "Subscription[M]":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def open(self, session: zenoh.Session, key: str, history: int = 0) -> None:
        """Declares the subscriber on a session.

        Args:
            session: The session.
            key: The topic's key.
            history: How many earlier messages to request.
        """
        handler = Callback(self._receive, indirect=False)
        if history:
            self._declared.append(
                declare_advanced_subscriber(
                    session, key, handler, history=HistoryConfig(detect_late_publishers=True, max_samples=history)
                )
            )
        else:
            self._declared.append(session.declare_subscriber(key, handler))
        if self._thread is not None:
            self._thread.start()

    def _receive(self, sample: zenoh.Sample) -> None:
        if sample.kind != zenoh.SampleKind.PUT:
            return
        received = time_ns()
        origin = origin_of(sample.attachment)
        with self._receiving:
            arrival = _Arrival(sample, MessageInfo(received, origin, self._gaps.count(origin)))
            # The oldest one is dropped first; otherwise, a reader that takes it meanwhile could lose the newest.
            if len(self._queue) >= self._depth and self._oldest() is not None:
                self.dropped += 1
            self._queue.append(arrival)
            self._newest = arrival
        self._changed.notify()

    def _oldest(self) -> _Arrival | None:
        try:
            return self._queue.popleft()
        except IndexError:
            return None

    def _take(self, timeout: float | None) -> _Arrival | None:
        """Returns the oldest message that waits; None when the subscription is closed."""
        limit = None if timeout is None else bounded(timeout)
        arrival, closed = self._changed.wait_for(self._oldest_or_end, limit) or (None, False)
        if arrival is None and not closed:
            raise TimedOutError(f"no message on {self.name} within {timeout:g} s")
        return arrival

    def _oldest_or_end(self) -> tuple[_Arrival | None, bool] | None:
        # In this order, because the last messages may arrive while the subscription is being closed.
        closed, arrival = self._closed, self._oldest()
        return None if arrival is None and not closed else (arrival, closed)

    def _message(self, arrival: _Arrival) -> M:
        self.info = arrival.info
        try:
            message: M = self._decode(arrival.sample)
            return message
        except (PayloadError, ValueError) as error:
            raise WrongTypeError(f"a message on {self.name} cannot be decoded: {error}") from error

    def _run(self, callback: Callable[[M], None]) -> None:
        while (arrival := self._take(None)) is not None:
            try:
                callback(self._message(arrival))
            except WrongTypeError as error:
                _log.error("%s", error)
            except Exception:
                _log.exception("the callback for %s failed", self.name)


def _decoder(type: Any) -> Callable[[zenoh.Sample], Any]:
    if type is bytes:
        return lambda sample: sample.payload.to_bytes()
    if type is dict:
        return lambda sample: json.loads(sample.payload.to_bytes())
    decoder = Decoder(type, Limits(_LARGEST, _LARGEST))
    return lambda sample: decoder.decode(Received(sample.payload, sample.encoding))[1]
