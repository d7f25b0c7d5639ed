"""A topic that is read: as an iterator, by a callback, or just its newest message."""

import json
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, Generic, TypeVar

import zenoh
from zenoh.ext import HistoryConfig, declare_advanced_subscriber
from zenoh.handlers import Callback

from mjplug.client.errors import ClientError, TimedOutError, WrongTypeError
from mjplug.client.timeouts import bounded
from mjplug.wire.encoding import Decoder, Limits, PayloadError, Received

_log = logging.getLogger(__name__)

M = TypeVar("M")

_LARGEST = 1 << 30
"""Zenoh's own limit of a message [bytes]; the server's limit is for what strangers send it."""


class Subscription(Generic[M]):
    """The messages of one topic. Thread-safe.

    Iterating yields each message as it comes, and ends when the subscription is closed:

        for clock in client.subscribe("/clock"):
            ...

    Zenoh's thread only puts payloads into a queue; they are decoded by whoever takes them out. If the
    reader is slower than the topic, the oldest ones are dropped.

    Attributes:
        name: The topic's full name.
        type: The class of its messages; `dict` for nested dictionaries, `bytes` for CDR as it comes.
        dropped: How many messages fell out of the queue unread.

    Args:
        name: As above.
        type: As above.
        depth: How many messages wait to be taken; 1 is the newest only.
        callback: Gets each message, on a thread of its own; nobody should iterate then.
    """

    def __init__(self, name: str, type: type[M], depth: int, callback: Callable[[M], None] | None = None) -> None:
        self.name = name
        self.type = type
        self.dropped = 0
        self._decode = _decoder(type)
        if depth < 1:
            raise ClientError(f"depth is how many messages may wait, at least 1, not {depth}")
        self._queue: deque[zenoh.Sample] = deque(maxlen=depth)
        self._newest: zenoh.Sample | None = None
        self._decoded: tuple[zenoh.Sample, M] | None = None
        self._changed = threading.Condition()
        self._closed = False
        self._declared: Any = None
        self._thread: threading.Thread | None = None
        if callback is not None:
            # A daemon, so that a program that forgets to close can still end.
            self._thread = threading.Thread(target=self._run, args=(callback,), name=f"mjplug{name}", daemon=True)

    @property
    def closed(self) -> bool:
        """Whether it has been closed."""
        return self._closed

    def __iter__(self) -> Iterator[M]:
        """Yields each message, until the subscription is closed."""
        while (sample := self._take(None)) is not None:
            yield self._message(sample)

    def next(self, timeout: float | None = None) -> M:
        """Returns the next message that nobody has taken yet.

        Args:
            timeout: How long to wait for it [s]; None is for ever.

        Raises:
            TimedOutError: It did not come in time.
            ClientError: The subscription is closed.
            WrongTypeError: Something else than the topic's type came.
        """
        sample = self._take(timeout)
        if sample is None:
            raise ClientError(f"the subscription to {self.name} is closed")
        return self._message(sample)

    def latest(self, timeout: float | None = 0.0) -> M | None:
        """Returns the newest message, whether it has been taken or not; None if there has been none.

        Args:
            timeout: How long to wait for a first one [s]; None is for ever.

        Raises:
            WrongTypeError: Something else than the topic's type came.
        """
        with self._changed:
            self._changed.wait_for(
                lambda: self._newest is not None or self._closed, None if timeout is None else bounded(timeout)
            )
            sample = self._newest
        if sample is None:
            return None
        if self._decoded is None or self._decoded[0] is not sample:
            self._decoded = (sample, self._message(sample))
        return self._decoded[1]

    def close(self) -> None:
        """Ends the subscription, and every wait for its messages; a second call does nothing."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
            declared, self._declared = self._declared, None
        if declared is not None:
            declared.undeclare()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(1.0)

    def __enter__(self) -> "Subscription[M]":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def open(self, session: zenoh.Session, key: str, history: int = 0) -> None:
        """Declares it on a session.

        Args:
            session: The session.
            key: The topic's key.
            history: How many of the messages that were published before to ask for.
        """
        handler = Callback(self._receive, indirect=False)
        if history:
            self._declared = declare_advanced_subscriber(
                session, key, handler, history=HistoryConfig(detect_late_publishers=True, max_samples=history)
            )
        else:
            self._declared = session.declare_subscriber(key, handler)
        if self._thread is not None:
            self._thread.start()

    def _receive(self, sample: zenoh.Sample) -> None:
        if sample.kind != zenoh.SampleKind.PUT:
            return
        with self._changed:
            self.dropped += len(self._queue) == self._queue.maxlen
            self._queue.append(sample)
            self._newest = sample
            self._changed.notify_all()

    def _take(self, timeout: float | None) -> zenoh.Sample | None:
        """Returns the oldest sample that waits; None when the subscription is closed."""
        until = None if timeout is None else time.monotonic() + bounded(timeout)
        with self._changed:
            while not self._queue:
                if self._closed:
                    return None
                left = None if until is None else until - time.monotonic()
                if left is not None and left <= 0.0:
                    raise TimedOutError(f"no message on {self.name} within {timeout:g} s")
                self._changed.wait(left)
            return self._queue.popleft()

    def _message(self, sample: zenoh.Sample) -> M:
        try:
            message: M = self._decode(sample)
            return message
        except (PayloadError, ValueError) as error:
            raise WrongTypeError(f"what came on {self.name} cannot be read: {error}") from error

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
