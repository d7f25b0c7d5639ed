"""A queue that drops the oldest messages if they arrive faster than they are handled."""

import threading
from collections import deque
from collections.abc import Callable
from typing import Any


class Newest:
    """Calls a function with each message on a separate thread.

    If more than `depth` messages wait, the oldest are dropped.

    Args:
        handle: Called with each message.
        depth: Largest number of waiting messages, at least 1.
    """

    def __init__(self, handle: Callable[[Any], None], depth: int) -> None:
        self._handle = handle
        self._waiting: deque[Any] = deque(maxlen=max(1, depth))
        self._changed = threading.Condition()
        self._closed = False
        threading.Thread(target=self._run, daemon=True).start()

    def add(self, message: Any) -> None:
        """Adds a message without blocking; can be called from any thread."""
        with self._changed:
            self._waiting.append(message)
            self._changed.notify()

    def close(self) -> None:
        """Drops the waiting messages; the handling of a current message is not interrupted."""
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
