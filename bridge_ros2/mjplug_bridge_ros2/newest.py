"""Keeps the newest messages of a topic for a reader that may be slower than the messages arrive."""

import threading
from collections import deque
from collections.abc import Callable
from typing import Any


class Newest:
    """Calls a function with each message, on a thread of its own.

    While more than `depth` messages wait, the oldest are dropped.

    Args:
        handle: Gets each message.
        depth: How many messages may wait, at least 1.
    """

    def __init__(self, handle: Callable[[Any], None], depth: int) -> None:
        self._handle = handle
        self._waiting: deque[Any] = deque(maxlen=max(1, depth))
        self._changed = threading.Condition()
        self._closed = False
        threading.Thread(target=self._run, daemon=True).start()

    def add(self, message: Any) -> None:
        """Takes a message, from any thread, and does not wait."""
        with self._changed:
            self._waiting.append(message)
            self._changed.notify()

    def close(self) -> None:
        """Drops what waits; a message that is being handled is handled to its end."""
        with self._changed:
            self._closed = True
            self._waiting.clear()
            self._changed.notify()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or self._closed)
                if self._closed:
                    return
                message = self._waiting.popleft()
            self._handle(message)
