"""Limits the rate of log lines about repeated faults."""

import logging
import sys
from time import perf_counter


class Throttle:
    """Admits one log line per interval of wall time, and counts the others.

    Args:
        interval: Minimum wall time between two admitted lines [s].
    """

    def __init__(self, interval: float) -> None:
        self._interval = interval
        self._next_line_at = float("-inf")
        self._suppressed = 0

    def admit(self, now: float) -> bool:
        """Returns whether a line may be logged at the wall time `now` [s]; if not, counts it."""
        if now < self._next_line_at:
            self._suppressed += 1
            return False
        self._next_line_at = now + self._interval
        return True

    def suppressed(self) -> str:
        """Returns ` (N more since the last line)` and resets the count; empty if no line was suppressed."""
        count, self._suppressed = self._suppressed, 0
        return f" ({count} more since the last line)" if count else ""


class FailureLog:
    """Logs failures that clients can cause repeatedly, with their tracebacks, at most once a second.

    Args:
        logger: The logger to use.
    """

    def __init__(self, logger: logging.Logger) -> None:
        self._logger = logger
        self._throttle = Throttle(1.0)

    def log(self, what: str) -> None:
        """Logs a sentence, and the exception that is being handled, if any."""
        if self._throttle.admit(perf_counter()):
            self._logger.error("%s%s", what, self._throttle.suppressed(), exc_info=sys.exc_info()[0] is not None)
