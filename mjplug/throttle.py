"""Keeps a fault that repeats from filling the log."""

import logging
import sys
from time import perf_counter


class Throttle:
    """Lets one log line through in each span of wall time, and counts the others.

    Args:
        seconds: Length of the span [s].
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._quiet_until = float("-inf")
        self._held = 0

    def admit(self, now: float) -> bool:
        """Whether a line may be logged at the wall time `now` [s]; if not, it is counted."""
        if now < self._quiet_until:
            self._held += 1
            return False
        self._quiet_until = now + self._seconds
        return True

    def held(self) -> str:
        """Returns ` (N more since the last line)` for the lines held back since it was last called, or nothing."""
        held, self._held = self._held, 0
        return f" ({held} more since the last line)" if held else ""


class FailureLog:
    """Logs failures that clients can repeat at will, with their tracebacks, at most once a second.

    Args:
        logger: Where they are logged.
    """

    def __init__(self, logger: logging.Logger) -> None:
        self._logger = logger
        self._throttle = Throttle(1.0)

    def log(self, what: str) -> None:
        """Logs a sentence, and the exception that is being handled if there is one; or counts it."""
        if self._throttle.admit(perf_counter()):
            self._logger.error("%s%s", what, self._throttle.held(), exc_info=sys.exc_info()[0] is not None)
