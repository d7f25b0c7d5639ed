"""SIGINT and SIGTERM as a wish to end, for commands that complete something before they end."""

import signal
from types import FrameType

from mjplug.wakeup import Flag


class EndingSignals:
    """Counts SIGINT and SIGTERM inside a `with` block, instead of raising KeyboardInterrupt.

    Attributes:
        count: Number of signals.
        last: The last one.
    """

    def __init__(self) -> None:
        self.count = 0
        self.last = signal.SIGINT
        # `threading.Event` could wait for its own lock in a signal handler.
        self._arrived = Flag()

    def wait(self, timeout: float) -> bool:
        """Waits for a signal; returns whether one has arrived.

        Args:
            timeout: How long to wait [s].
        """
        return self._arrived.wait(timeout)

    def __enter__(self) -> "EndingSignals":
        self._before = {number: signal.signal(number, self._add) for number in (signal.SIGINT, signal.SIGTERM)}
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _add(self, number: int, frame: FrameType | None) -> None:
        self.count += 1
        self.last = signal.Signals(number)
        self._arrived.set()
