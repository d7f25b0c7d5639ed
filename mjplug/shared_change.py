"""Process-wide changes that several servers in one process need at the same time."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Undo = Callable[[], None]


class SharedChange:
    """A process-wide change, such as Python's switch interval. Thread-safe.

    The first `hold` makes the change, and the last `release` undoes it. If each server saved and restored the value
    itself, two servers that do not stop in the reverse order of their starts would leave a wrong value.

    Args:
        make: Makes the change, and returns a function that undoes it.
    """

    def __init__(self, make: Callable[[], Undo]) -> None:
        self._make = make
        self._undo: Undo | None = None
        self._holders = 0
        self._lock = threading.Lock()

    @contextmanager
    def held(self) -> Iterator[None]:
        """Keeps the change in place until the end of the block."""
        self.hold()
        try:
            yield
        finally:
            self.release()

    def hold(self) -> None:
        """Makes the change, unless it is already made. Each call needs a `release`; until then, the change stays."""
        with self._lock:
            if self._undo is None:
                self._undo = self._make()
            self._holders += 1

    def release(self) -> None:
        """Undoes the change if there is no other `hold`."""
        with self._lock:
            self._holders -= 1
            if self._holders == 0 and self._undo is not None:
                undo, self._undo = self._undo, None
                undo()
