"""Ctrl-C between two calls of MuJoCo's viewer: inside one, an exception makes it crash or hang."""

import signal
from types import FrameType, TracebackType
from typing import Any


class DelayedInterrupt:
    """Notes Ctrl-C inside a `with` block, and raises KeyboardInterrupt at its end; a second Ctrl-C raises it at once.

    Attributes:
        requested: Whether Ctrl-C was pressed.
    """

    def __init__(self) -> None:
        self.requested = False
        self._before: Any = None
        self._installed = False

    def __enter__(self) -> "DelayedInterrupt":
        try:
            self._before = signal.signal(signal.SIGINT, self._note)
        except ValueError:
            # Only the main thread gets signals.
            return self
        self._installed = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._installed:
            signal.signal(signal.SIGINT, self._before)
        if self.requested and error is None:
            raise KeyboardInterrupt

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True
