"""The one way into the physics thread: other threads post calls, the loop runs them between steps."""

import logging
from collections.abc import Callable
from queue import Empty, SimpleQueue
from time import perf_counter

from mjplug.throttle import Throttle

Task = Callable[[], None]

LONGEST_WAIT = 3600.0
"""Bound on one wait [s]; the operating system refuses waits of centuries, as tiny speed factors would ask for."""


REPORT_SECONDS = 10.0
"""Wall time between two log lines about calls that come in too fast [s]."""

MANY_OVERRUNS = 20
"""Overruns since the last report that are reported; fewer are what a few slow calls do."""

_log = logging.getLogger(__name__)


class Inbox:
    """A queue of calls to make on the physics thread.

    `post` and `interrupt` may be called from any thread, the rest only from the loop's.

    Attributes:
        interrupted: Whether the loop is to end, so that nothing on its thread should wait for long any more.
        overfull: Whether the last `drain` ran out of time before it was through.
        overruns: How often a `drain` has run out of time.
        replaced: By topic, how many messages a newer one has replaced before they were handled.
    """

    def __init__(self) -> None:
        self._queue: SimpleQueue[Task] = SimpleQueue()
        self.empty = self._queue.empty
        self.interrupted = False
        self.overfull = False
        self.overruns = 0
        self.replaced: dict[str, int] = {}
        self._reported = 0
        self._throttle = Throttle(REPORT_SECONDS)

    @property
    def waiting(self) -> int:
        """How many calls wait."""
        return self._queue.qsize()

    def post(self, task: Task) -> None:
        """Queues a call; wakes the loop if it waits."""
        self._queue.put(task)

    def interrupt(self, stop: Task) -> None:
        """Queues the call that ends the loop. May be called from a signal handler too, at any point of the loop."""
        self.interrupted = True
        self.post(stop)

    def drain(self, seconds: float) -> None:
        """Runs what was queued when it was called, but begins nothing after `seconds` [s]: steps must be taken too."""
        until = perf_counter() + seconds
        self.overfull = False
        for _ in range(self._queue.qsize()):
            self._queue.get_nowait()()
            if perf_counter() > until:
                self.overfull = not self.empty()
                self.overruns += self.overfull
                return

    def report(self, now: float) -> None:
        """Logs, at most once in `REPORT_SECONDS`, that calls come in too fast.

        Args:
            now: Wall time [s].
        """
        since, self._reported = self.overruns - self._reported, self.overruns
        if since >= MANY_OVERRUNS and self._throttle.admit(now):
            _log.warning(
                "requests and messages come in faster than they can be handled: %d wait; physics gets about half of "
                "the time of its thread%s",
                self.waiting,
                self._throttle.held(),
            )

    def wait(self, seconds: float) -> None:
        """Waits for a call and runs it, for at most `seconds` [s] and never longer than `LONGEST_WAIT`."""
        try:
            task = self._next(min(seconds, LONGEST_WAIT))
        except Empty:
            return
        task()

    def _next(self, seconds: float) -> Task:
        # Before Python 3.13, `get` may wait for ever when its time is over as it begins and the last call was taken
        # without waiting for it. Asking in vain first puts that right.
        try:
            return self._queue.get_nowait()
        except Empty:
            return self._queue.get(timeout=seconds)
