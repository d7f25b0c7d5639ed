"""SIGINT and SIGTERM stop the server at its next step; a second one ends the process at once."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic
from types import FrameType

from mjplug.lifecycle.watchdog import SAME_SIGNAL
from mjplug.physics.loop import Loop


@contextmanager
def stopping_on_signals(loop: Loop) -> Iterator[None]:
    """Stops the loop between two steps after SIGINT or SIGTERM; a second signal ends the process at once.

    A repetition within `SAME_SIGNAL` counts as the same signal: `timeout`, for example, sends each signal to the
    process and to its group.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    first: list[float] = []

    def stop(number: int, frame: FrameType | None) -> None:
        if not first:
            first.append(monotonic())
            loop.inbox.interrupt(loop.stop)
        elif monotonic() - first[0] > SAME_SIGNAL:
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)

    for number in before:
        signal.signal(number, stop)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
