"""Timers in wall time: they run while paused and at any speed, and cost one comparison per turn of the loop."""

from collections.abc import Callable
from math import inf


class WallTimer:
    """Calls a function once at a wall time, on the physics thread; `set` it again for the next call.

    Attributes:
        due: When the function is called [s, by `perf_counter`]; infinity while the timer is off.

    Args:
        callback: Called with the wall time [s].
        changed: Called when `due` was changed.
    """

    def __init__(self, callback: Callable[[float], None], changed: Callable[[], None]) -> None:
        self.callback = callback
        self.due = inf
        self._changed = changed

    def set(self, due: float) -> None:
        """Calls the function at the wall time `due` [s], instead of the time set before."""
        self.due = due
        self._changed()

    def stop(self) -> None:
        """Turns the timer off."""
        self.set(inf)


class WallTimers:
    """All wall timers of a loop. Physics thread only.

    Attributes:
        next_due: The earliest time at which a timer is due [s]; infinity if none is set.
    """

    def __init__(self) -> None:
        self.next_due = inf
        self._timers: list[WallTimer] = []

    def create(self, callback: Callable[[float], None]) -> WallTimer:
        """Returns a new timer, which is off.

        Args:
            callback: Called with the wall time [s] on the physics thread.
        """
        timer = WallTimer(callback, self._update)
        self._timers.append(timer)
        return timer

    def run_due(self, now: float) -> None:
        """Calls the timers that are due at the wall time `now` [s]; each is turned off before its call."""
        for timer in self._timers:
            if timer.due <= now:
                timer.due = inf
                timer.callback(now)
        self._update()

    def _update(self) -> None:
        self.next_due = min((timer.due for timer in self._timers), default=inf)
