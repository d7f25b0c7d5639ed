"""Hands the messages of one subscription to the physics thread; a flood takes a fixed amount of memory."""

from collections import deque
from collections.abc import Callable
from functools import partial
from threading import Lock
from typing import Generic, TypeVar

from mjplug.physics.inbox import Inbox

M = TypeVar("M")

MOST_POSTED = 64
"""Calls of one subscription that may wait in the inbox at the same time."""


class Arrivals(Generic[M]):
    """Keeps the newest messages until the physics thread takes them.

    Each message keeps its place among the requests and messages that clients send. Only if `MOST_POSTED` messages of
    this subscription wait already, a further one is handed over together with a message that comes before or after it.

    Args:
        topic: Full name of the topic; the inbox counts its replaced messages under it.
        depth: How many messages to keep; a newer one replaces the oldest.
        inbox: The way to the physics thread.
        handle: Gets each message, on the physics thread.
    """

    def __init__(self, topic: str, depth: int, inbox: Inbox, handle: Callable[[M], None]) -> None:
        self._topic = topic
        self._depth = depth
        self._inbox = inbox
        self._handle = handle
        self._lock = Lock()
        self._kept: deque[tuple[int, M]] = deque(maxlen=depth)
        self._count = 0
        self._posted = 0

    def deliver(self, message: M) -> None:
        """Takes a message, on any thread."""
        with self._lock:
            self._count = number = self._count + 1
            if len(self._kept) == self._depth:
                self._inbox.replaced[self._topic] = self._inbox.replaced.get(self._topic, 0) + 1
            self._kept.append((number, message))
            if self._posted == MOST_POSTED:
                return
            self._posted += 1
        self._inbox.post(partial(self._take, number))

    def _take(self, number: int) -> None:
        """Hands over the messages up to `number`; the last call that was posted hands over all."""
        with self._lock:
            self._posted -= 1
            last = number if self._posted else self._count
            messages = []
            while self._kept and self._kept[0][0] <= last:
                messages.append(self._kept.popleft()[1])
        for message in messages:
            self._handle(message)
