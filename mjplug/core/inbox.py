"""The one way into the physics thread: other threads post calls, the loop runs them between steps."""

from collections.abc import Callable
from queue import Empty, SimpleQueue
from time import perf_counter

Task = Callable[[], None]

LONGEST_WAIT = 3600.0
"""Bound on one wait [s]; the operating system refuses waits of centuries, as tiny speed factors would ask for."""


class Inbox:
    """A queue of calls to make on the physics thread.

    `post` may be called from any thread, the rest only from the loop's.
    """

    def __init__(self) -> None:
        self._queue: SimpleQueue[Task] = SimpleQueue()
        self.empty = self._queue.empty

    def post(self, task: Task) -> None:
        """Queues a call; wakes the loop if it waits."""
        self._queue.put(task)

    def drain(self, seconds: float) -> None:
        """Runs what was queued when it was called, but begins nothing after `seconds` [s]: steps must be taken too."""
        until = perf_counter() + seconds
        for _ in range(self._queue.qsize()):
            self._queue.get_nowait()()
            if perf_counter() > until:
                return

    def wait(self, seconds: float) -> None:
        """Waits for a call and runs it, for at most `seconds` [s] and never longer than `LONGEST_WAIT`."""
        try:
            task = self._queue.get(timeout=min(seconds, LONGEST_WAIT))
        except Empty:
            return
        task()
