"""Subscriptions of the client: as an iterator, by a callback, or only the newest message."""

import json
import logging
import threading
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, Generic, TypeVar

import zenoh
from zenoh.ext import HistoryConfig, declare_advanced_subscriber
from zenoh.handlers import Callback

from mjplug.client.errors import ClientError, TimedOutError, WrongTypeError
from mjplug.client.timeouts import bounded
from mjplug.wakeup import Wakeup
from mjplug.wire.encoding import Decoder, Limits, PayloadError, Received

_log = logging.getLogger(__name__)

M = TypeVar("M")

_LARGEST = 1 << 30
"""Zenoh's limit for a message [bytes]; the lower limit of the server is for incoming messages only."""


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
        dropped: Number of messages that were dropped before they were read.

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
        self._decode = _decoder(type)
        if depth < 1:
            raise ClientError(f"depth is {depth}; it must be at least 1, the number of messages that can wait")
        self._depth = depth
        self._queue: deque[zenoh.Sample] = deque()
        self._newest: zenoh.Sample | None = None
        self._decoded: tuple[zenoh.Sample, M] | None = None
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

    def __iter__(self) -> Iterator[M]:
        """Yields each message until the subscription is closed."""
        while (sample := self._take(None)) is not None:
            yield self._message(sample)

    def next(self, timeout: float | None = None) -> M:
        """Returns the oldest message that has not been taken yet.

        Args:
            timeout: How long to wait [s]; None for no limit.

        Raises:
            TimedOutError: No message arrived in time.
            ClientError: The subscription is closed.
            WrongTypeError: The payload does not match the topic's type.
        """
        sample = self._take(timeout)
        if sample is None:
            raise ClientError(f"the subscription to {self.name} is closed")
        return self._message(sample)

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
        sample, decoded = self._newest, self._decoded
        if sample is None:
            return None
        if decoded is None or decoded[0] is not sample:
            decoded = self._decoded = (sample, self._message(sample))
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
        with self._receiving:
            # The oldest one is dropped first; otherwise, a reader that takes it meanwhile could lose the newest.
            if len(self._queue) >= self._depth and self._oldest() is not None:
                self.dropped += 1
            self._queue.append(sample)
            self._newest = sample
        self._changed.notify()

    def _oldest(self) -> zenoh.Sample | None:
        try:
            return self._queue.popleft()
        except IndexError:
            return None

    def _take(self, timeout: float | None) -> zenoh.Sample | None:
        """Returns the oldest sample that waits; None when the subscription is closed."""
        limit = None if timeout is None else bounded(timeout)
        sample, closed = self._changed.wait_for(self._oldest_or_end, limit) or (None, False)
        if sample is None and not closed:
            raise TimedOutError(f"no message on {self.name} within {timeout:g} s")
        return sample

    def _oldest_or_end(self) -> tuple[zenoh.Sample | None, bool] | None:
        # In this order, because the last messages may arrive while the subscription is being closed.
        closed, sample = self._closed, self._oldest()
        return None if sample is None and not closed else (sample, closed)

    def _message(self, sample: zenoh.Sample) -> M:
        try:
            message: M = self._decode(sample)
            return message
        except (PayloadError, ValueError) as error:
            raise WrongTypeError(f"a message on {self.name} cannot be decoded: {error}") from error

    def _run(self, callback: Callable[[M], None]) -> None:
        while (sample := self._take(None)) is not None:
            try:
                callback(self._message(sample))
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
