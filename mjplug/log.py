"""Log lines for a person: time, level where it matters, who, what; written by a thread of their own."""

import contextlib
import logging
import logging.handlers
import queue
import sys
from collections.abc import Iterator

INSTANCES = "mjplug.instance"
"""Parent of the logger of every plugin instance."""

_COLOURS = {
    logging.WARNING: "\033[33m",
    logging.ERROR: "\033[31m",
    logging.CRITICAL: "\033[31m",
    logging.DEBUG: "\033[2m",
}


class _Formatter(logging.Formatter):
    def __init__(self, colour: bool) -> None:
        super().__init__("%(asctime)s %(who)s%(mark)s%(message)s", datefmt="%H:%M:%S")
        self._colour = colour

    def format(self, record: logging.LogRecord) -> str:
        record.who = _who(record.name)
        record.mark = "" if record.levelno == logging.INFO else f"{record.levelname.lower()}: "
        line = super().format(record)
        colour = _COLOURS.get(record.levelno) if self._colour else None
        return f"{colour}{line}\033[0m" if colour else line


def _who(logger: str) -> str:
    """Returns `instance: ` for a plugin's own logger, nothing for the server's modules."""
    instance = logger.removeprefix(f"{INSTANCES}.")
    return "" if instance == logger else f"{instance}: "


def ros_string(text: str) -> str:
    """Returns a text as a ROS string can hold it: without NUL, and without what is no character."""
    return text.encode("utf-8", "replace").decode().replace("\0", "\N{REPLACEMENT CHARACTER}")


@contextlib.contextmanager
def logging_to_stderr(verbosity: int) -> Iterator[None]:
    """Sends log records to standard error until the end of the block.

    A thread writes them, so that a slow terminal never holds up a step.

    Args:
        verbosity: -1 shows warnings only, 0 what happens, 1 and more everything.
    """
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(_Formatter(colour=sys.stderr.isatty()))
    records: queue.SimpleQueue[logging.LogRecord] = queue.SimpleQueue()
    listener = logging.handlers.QueueListener(records, handler)
    root, queued = logging.getLogger(), logging.handlers.QueueHandler(records)
    before = root.level
    root.addHandler(queued)
    root.setLevel(logging.WARNING if verbosity < 0 else logging.INFO if verbosity == 0 else logging.DEBUG)
    listener.start()
    try:
        yield
    finally:
        listener.stop()
        root.removeHandler(queued)
        root.setLevel(before)
