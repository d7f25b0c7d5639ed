"""Ctrl-C while modules are imported, when a command has not opened anything that it would have to close."""

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def exit_on_interrupt() -> Iterator[None]:
    """Lets Ctrl-C end the process at once inside the block, without a word.

    Python would raise KeyboardInterrupt in the middle of an import, where some libraries replace it by an exception of
    their own, and where nobody catches it. After the block, Ctrl-C does what it did before. A signal that is ignored,
    as in a script's background job, stays ignored.
    """
    before = signal.getsignal(signal.SIGINT)
    # Python lets only the main thread set handlers.
    if before is not signal.default_int_handler or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(signal.SIGINT, _exit)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _exit(number: int, frame: FrameType | None) -> None:
    os._exit(128 + number)
