"""Counts rejected messages and requests, and logs some of them, so that a flood does not fill the log."""

import logging
import threading

_LOG = logging.getLogger(__name__)

_MAX_REASON_LENGTH = 500
"""Maximum length of a logged reason [characters]; the reason may quote text that a client sent."""


class Rejections:
    """Counts one kind of rejection, and logs the first, the tenth, the hundredth and so on.

    Attributes:
        count: Number of rejections.

    Args:
        what: Subject of the log line, such as `topic /cmd_vel: a sample was refused`.
        level: The level of the log line.
    """

    def __init__(self, what: str, level: int = logging.WARNING) -> None:
        self._what = what
        self._level = level
        self._lock = threading.Lock()
        self._next = 1
        self.count = 0

    def add(self, reason: str) -> None:
        """Counts one rejection, and logs it with its reason if it is due."""
        with self._lock:
            self.count += 1
            count = self.count
            if count < self._next:
                return
            self._next *= 10
        short = reason if len(reason) <= _MAX_REASON_LENGTH else reason[:_MAX_REASON_LENGTH] + " …"
        _LOG.log(self._level, "%s (%d so far): %s", self._what, count, short)
