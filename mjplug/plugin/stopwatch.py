"""Measures the time that a plugin takes on the physics thread, at little cost."""

from collections.abc import Callable
from time import perf_counter
from typing import Protocol

SAMPLES_PER_PERIOD = 16
"""Number of updates measured in each period; the others run without measurement, at full speed."""


class Updated(Protocol):
    """A stepper whose attribute `update` is read again before every step, so that it can be replaced."""

    update: Callable[[], None]


class Stopwatch:
    """Measures the time of one plugin instance. Physics thread only.

    Attributes:
        calls: Calls for timers, messages and requests.
        seconds: Wall time of these calls [s].
    """

    __slots__ = ("_left", "_measured", "_stepper", "_update", "calls", "seconds")

    def __init__(self) -> None:
        self.calls = 0
        self.seconds = 0.0
        self._stepper: Updated | None = None
        self._update: Callable[[], None]
        self._measured = 0.0
        self._left = SAMPLES_PER_PERIOD

    def add(self, began: float) -> None:
        """Counts a call that ends now.

        Args:
            began: Start of the call, by `perf_counter` [s].
        """
        self.seconds += perf_counter() - began
        self.calls += 1

    def watch(self, stepper: Updated) -> None:
        """Sets the stepper whose updates are measured."""
        self._stepper, self._update = stepper, stepper.update

    @property
    def measured(self) -> int:
        """Number of updates measured in this period; if fewer than `SAMPLES_PER_PERIOD`, there were no others."""
        return SAMPLES_PER_PERIOD - self._left

    def update_time(self) -> float | None:
        """Returns the mean time of the updates measured in this period [s], and starts a new period.

        Returns None if no update was measured.
        """
        count, measured = self.measured, self._measured
        self._left, self._measured = SAMPLES_PER_PERIOD, 0.0
        if self._stepper is not None:
            self._stepper.update = self._timed
        return measured / count if count else None

    def _timed(self) -> None:
        began = perf_counter()
        try:
            self._update()
        finally:
            self._measured += perf_counter() - began
            self._left -= 1
            if not self._left and self._stepper is not None:
                self._stepper.update = self._update
