"""How much time a plugin takes on the physics thread, measured at next to no cost."""

from collections.abc import Callable
from time import perf_counter
from typing import Protocol

SAMPLES = 16
"""How many updates are measured after each look; the others are not slowed down."""


class Updated(Protocol):
    """What is updated before every step; `update` is looked up anew each time."""

    update: Callable[[], None]


class Stopwatch:
    """Counts the time of one plugin. Physics thread only.

    Attributes:
        calls: Timers, messages and requests that it was called for.
        seconds: Time that those took [s].
    """

    __slots__ = ("_left", "_measured", "_stepper", "_update", "calls", "seconds")

    def __init__(self) -> None:
        self.calls = 0
        self.seconds = 0.0
        self._stepper: Updated | None = None
        self._update: Callable[[], None]
        self._measured = 0.0
        self._left = SAMPLES

    def add(self, began: float) -> None:
        """Counts a call that began at some time, by `perf_counter`, and ends now."""
        self.seconds += perf_counter() - began
        self.calls += 1

    def watch(self, stepper: Updated) -> None:
        """Takes up the stepper whose updates are to be measured now and then."""
        self._stepper, self._update = stepper, stepper.update

    @property
    def measured(self) -> int:
        """Updates that were measured since the last look; fewer than `SAMPLES`: there were no others."""
        return SAMPLES - self._left

    def update_time(self) -> float | None:
        """Returns the mean time of the updates that were measured since the last look [s]; None if there were none.

        The next ones will be measured.
        """
        count, measured = self.measured, self._measured
        self._left, self._measured = SAMPLES, 0.0
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
