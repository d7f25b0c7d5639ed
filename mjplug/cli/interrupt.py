"""Ctrl-C during imports, before a command has opened anything that it must close."""

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def exit_on_interrupt() -> Iterator[None]:
    """Lets Ctrl-C end the process inside the block, at once and without output.

    Python would raise KeyboardInterrupt in the middle of an import, where no code catches it, and where some libraries
    replace it by an exception of their own. The block restores the previous handler at its end. A signal that is
    ignored, as in a background job of a script, stays ignored.
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
