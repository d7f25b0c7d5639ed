"""Counts what had to be thrown away, and says so in the log without letting a flood fill it."""

import logging
import threading

_LOG = logging.getLogger(__name__)

_LONGEST = 500
"""The sentence may quote what a stranger sent; the log gets this many characters of it."""


class Rejections:
    """The count of one kind of loss, logged at the first, the tenth, the hundredth and so on.

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
        """Counts one more."""
        with self._lock:
            self.count += 1
            count = self.count
            if count < self._next:
                return
            self._next *= 10
        short = reason if len(reason) <= _LONGEST else reason[:_LONGEST] + " …"
        _LOG.log(self._level, "%s (%d so far): %s", self._what, count, short)
