"""Log lines on standard error, written by a separate thread: time, plugin instance, level, message.

Log messages may contain text from other programs: names, error messages, parts of payloads. A message is therefore
always one line, with control characters escaped (`one_line`). Tracebacks keep their line breaks, but their lines are
indented, so that none of them can be mistaken for a log line. `/rosout` contains the same text.
"""

import contextlib
import logging
import logging.handlers
import queue
import sys
from collections.abc import Iterator

from mjplug.printable import INDENT, lines, one_line

INSTANCES = "mjplug.instance"
"""Name of the parent logger of all plugin instances."""

_COLOURS = {
    logging.WARNING: "\033[33m",
    logging.ERROR: "\033[31m",
    logging.CRITICAL: "\033[31m",
    logging.DEBUG: "\033[2m",
}


class PrintableFormatter(logging.Formatter):
    """Formats the message and the traceback of a record, with all control characters escaped."""

    def format(self, record: logging.LogRecord) -> str:
        """Returns the escaped text of a record. Records from `PrintableQueueHandler` are already escaped."""
        if getattr(record, "printable", False):
            return record.getMessage()
        text = one_line(record.getMessage())
        if record.exc_info:
            text = f"{text}\n{INDENT}{lines(self.formatException(record.exc_info))}"
        elif record.exc_text:
            text = f"{text}\n{INDENT}{lines(record.exc_text)}"
        if record.stack_info:
            text = f"{text}\n{INDENT}{lines(record.stack_info)}"
        return text


class PrintableQueueHandler(logging.handlers.QueueHandler):
    """Puts records with escaped text into a queue; the handler that reads the queue writes the text unchanged."""

    def __init__(self, queue: "queue.SimpleQueue[logging.LogRecord] | None") -> None:
        super().__init__(queue)  # type: ignore[arg-type]
        self.setFormatter(PrintableFormatter())

    def prepare(self, record: logging.LogRecord) -> logging.LogRecord:
        """Returns a copy of the record with its final text."""
        prepared: logging.LogRecord = super().prepare(record)
        prepared.printable = True
        return prepared


class _Formatter(PrintableFormatter):
    def __init__(self, colour: bool) -> None:
        super().__init__(datefmt="%H:%M:%S")
        self._colour = colour

    def format(self, record: logging.LogRecord) -> str:
        mark = "" if record.levelno == logging.INFO else f"{record.levelname.lower()}: "
        line = f"{self.formatTime(record, self.datefmt)} {_instance_prefix(record.name)}{mark}{super().format(record)}"
        colour = _COLOURS.get(record.levelno) if self._colour else None
        return f"{colour}{line}\033[0m" if colour else line


def _instance_prefix(logger: str) -> str:
    """Returns `<instance>: ` for the logger of a plugin instance, otherwise an empty string."""
    instance = logger.removeprefix(f"{INSTANCES}.")
    return "" if instance == logger else f"{instance}: "


def ros_string(text: str) -> str:
    """Returns a text as a valid ROS string: NUL and lone surrogates are replaced."""
    return text.encode("utf-8", "replace").decode().replace("\0", "\N{REPLACEMENT CHARACTER}")


@contextlib.contextmanager
def logging_to_stderr(verbosity: int) -> Iterator[None]:
    """Writes log records to standard error until the end of the block.

    A separate thread writes them, so that a slow terminal never delays a step.

    Args:
        verbosity: -1 or less logs warnings and errors, 0 also information, 1 or more also debug messages.
    """
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(_Formatter(colour=sys.stderr.isatty()))
    records: queue.SimpleQueue[logging.LogRecord] = queue.SimpleQueue()
    listener = logging.handlers.QueueListener(records, handler)
    root, queued = logging.getLogger(), PrintableQueueHandler(records)
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
