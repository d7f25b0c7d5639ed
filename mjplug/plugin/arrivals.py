"""Passes the messages of one subscription to the physics thread, with bounded memory."""

from collections import deque
from collections.abc import Callable
from functools import partial
from threading import Lock
from typing import Generic, TypeVar

from mjplug.physics.inbox import Inbox

M = TypeVar("M")

MAX_POSTED = 64
"""Maximum number of calls of one subscription that wait in the inbox at the same time."""


class Arrivals(Generic[M]):
    """Keeps the newest messages until the physics thread handles them.

    Messages are handled in the order of arrival, also relative to requests and messages of other topics. Only if
    `MAX_POSTED` calls of this subscription already wait, a further message is handled together with an earlier or a
    later one.

    Args:
        topic: Full name of the topic; the inbox counts replaced messages by this name.
        depth: Number of messages to keep; a newer one replaces the oldest.
        inbox: The inbox of the physics thread.
        handle: Called with each message on the physics thread.
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
        """Queues a message. May be called from any thread."""
        with self._lock:
            self._count = number = self._count + 1
            if len(self._kept) == self._depth:
                self._inbox.replaced[self._topic] = self._inbox.replaced.get(self._topic, 0) + 1
            self._kept.append((number, message))
            if self._posted == MAX_POSTED:
                return
            self._posted += 1
        self._inbox.post(partial(self._take, number))

    def _take(self, number: int) -> None:
        """Handles the messages up to `number`; the last posted call handles all."""
        with self._lock:
            self._posted -= 1
            last = number if self._posted else self._count
            messages = []
            while self._kept and self._kept[0][0] <= last:
                messages.append(self._kept.popleft()[1])
        for message in messages:
            self._handle(message)
