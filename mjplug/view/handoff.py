"""Passes work from Zenoh's threads to the event loop."""

import asyncio
from collections import deque
from collections.abc import Callable


class Handoff:
    """Calls functions on the event loop, with one wake-up for any number of them.

    Args:
        loop: The event loop.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._waiting: deque[Callable[[], None]] = deque()
        self._woken = False

    def post(self, action: Callable[[], None]) -> None:
        """Calls a function on the event loop soon. Any thread."""
        self._waiting.append(action)
        if self._woken:
            return
        self._woken = True
        try:
            self._loop.call_soon_threadsafe(self._run)
        except RuntimeError:
            # The loop has ended; Zenoh may deliver samples until the session is closed.
            self._waiting.clear()

    def _run(self) -> None:
        # First, so that a function that is posted meanwhile wakes the loop again.
        self._woken = False
        for _ in range(len(self._waiting)):
            self._waiting.popleft()()
