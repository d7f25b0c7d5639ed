"""The queue of calls for the physics thread. Other threads post calls; the loop runs them between steps."""

import logging
from collections.abc import Callable
from queue import Empty, SimpleQueue
from time import perf_counter

from mjplug.throttle import Throttle

Task = Callable[[], None]

MAX_WAIT = 3600.0
"""Maximum time of one wait [s]; very small speed factors would need waits that the operating system refuses."""

REPORT_INTERVAL = 10.0
"""Minimum wall time between two log lines about overruns [s]."""

MIN_REPORTED_OVERRUNS = 20
"""Minimum number of overruns in one report; a few slow calls cause fewer, which are not reported."""

_log = logging.getLogger(__name__)


class Inbox:
    """A queue of calls to make on the physics thread.

    `post` and `interrupt` may be called from any thread, the other methods only from the physics thread.

    Attributes:
        interrupted: Whether the loop was asked to end. Nothing on the physics thread should then wait for long.
        overfull: Whether the last `drain` ran out of time before the queue was empty.
        overruns: How often a `drain` ran out of time.
        replaced: Messages that a newer one replaced before they were handled, by topic.
    """

    def __init__(self) -> None:
        self._queue: SimpleQueue[Task] = SimpleQueue()
        self.empty = self._queue.empty
        self.interrupted = False
        self.overfull = False
        self.overruns = 0
        self.replaced: dict[str, int] = {}
        self._reported = 0
        self._throttle = Throttle(REPORT_INTERVAL)

    @property
    def waiting(self) -> int:
        """Number of waiting calls."""
        return self._queue.qsize()

    def post(self, task: Task) -> None:
        """Queues a call, and wakes the loop if it waits."""
        self._queue.put(task)

    def interrupt(self, stop: Task) -> None:
        """Queues the call that ends the loop. May also be called from a signal handler at any point of the loop."""
        self.interrupted = True
        self.post(stop)

    def drain(self, seconds: float) -> None:
        """Runs the calls that are queued now. It starts no call after `seconds` [s], so that steps are taken too."""
        until = perf_counter() + seconds
        self.overfull = False
        for _ in range(self._queue.qsize()):
            self._queue.get_nowait()()
            if perf_counter() > until:
                self.overfull = not self.empty()
                self.overruns += self.overfull
                return

    def report_overruns(self, now: float) -> None:
        """Logs, at most once in `REPORT_INTERVAL`, that calls arrive faster than they are handled.

        Args:
            now: Wall time [s].
        """
        since, self._reported = self.overruns - self._reported, self.overruns
        if since >= MIN_REPORTED_OVERRUNS and self._throttle.admit(now):
            _log.warning(
                "requests and messages arrive faster than they can be handled: %d are waiting; the physics thread "
                "spends about half of its time on them%s",
                self.waiting,
                self._throttle.suppressed(),
            )

    def wait(self, seconds: float) -> None:
        """Waits for a call for at most `seconds` [s], and at most `MAX_WAIT`; runs it."""
        try:
            task = self._next(min(seconds, MAX_WAIT))
        except Empty:
            return
        task()

    def _next(self, seconds: float) -> Task:
        # Before Python 3.13, `get` with a timeout that has already passed may block for ever if the last call was
        # taken without waiting. A failed `get_nowait` first avoids that.
        try:
            return self._queue.get_nowait()
        except Empty:
            return self._queue.get(timeout=seconds)
