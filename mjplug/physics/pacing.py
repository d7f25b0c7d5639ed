"""Keeps simulated time in step with the wall clock, by absolute deadlines."""

import logging
from typing import Literal

from mjplug.physics.step_time import StepTime
from mjplug.throttle import Throttle

LARGEST_LAG = 0.1
"""Lag [s of wall time] that is caught up; what is beyond it is dropped."""

WAKE_EVERY = 0.001
"""Wall time [s] below which steps are not woken up for one by one."""

STOPPED = 2.0
"""Lag dropped in one go [s] that means that the process did not run, rather than that steps take too long."""

REPORT_SECONDS = 10.0
"""Wall time between two log lines about lag [s]."""

_log = logging.getLogger(__name__)

Speed = float | Literal["max"]


class Pacer:
    """Says which step is due at which wall time.

    Deadlines count from an anchor, so errors never add up; the anchor moves only when the speed changes, on a pause,
    and when the simulation cannot keep up.

    Attributes:
        speed: Real-time factor, or `max` for no pacing.
        dropped: Lag dropped since the start [s of wall time].
        drops: How often lag was dropped.

    Args:
        time: Step length.
        speed: Real-time factor from `limits.SLOWEST` to `limits.FASTEST`, or `max`.
    """

    def __init__(self, time: StepTime, speed: Speed) -> None:
        self.speed = speed
        self.dropped = 0.0
        self.drops = 0
        self._timestep = float(time.timestep)
        self._anchor_step = 0
        self._anchor = 0.0
        self._too_slow, self._did_not_run = Throttle(REPORT_SECONDS), Throttle(REPORT_SECONDS)

    @property
    def period(self) -> float:
        """Wall time of one step [s]; 0 at speed `max`."""
        return 0.0 if self.speed == "max" else self._timestep / self.speed

    @property
    def steps_per_wake(self) -> int:
        """How many steps to let fall due before waking up for them, where nothing else is due: about 1 ms."""
        return max(1, int(WAKE_EVERY / self.period))

    def anchor(self, step: int, now: float) -> None:
        """Makes `step` due at the wall time `now` [s]."""
        self._anchor_step, self._anchor = step, now

    def deadline(self, step: int) -> float:
        """Returns the wall time at which `step` is due [s]."""
        return self._anchor + (step - self._anchor_step) * self.period

    def due(self, step: int, now: float) -> int:
        """Returns the step that is due at the wall time `now`; drops and reports lag that is too large.

        Args:
            step: The step reached so far.
            now: Wall time [s].
        """
        lag = now - self.deadline(step)
        excess = lag - LARGEST_LAG - self.period
        if excess > 0.0:
            self.dropped += excess
            self.drops += 1
            self._report(now, excess)
            self._anchor += excess
            lag -= excess
        return step + max(0, int(lag / self.period + 1e-6))

    def _report(self, now: float, excess: float) -> None:
        if excess >= STOPPED:
            if self._did_not_run.admit(now):
                _log.warning(
                    "no step was taken for %.1f s of wall time, as when the process is stopped, the machine sleeps "
                    "or one call takes that long; simulated time goes on from where it was%s",
                    excess,
                    self._did_not_run.held(),
                )
        elif self._too_slow.admit(now):
            _log.warning(
                "physics cannot keep up: %.1f s of wall time lost so far at speed %g; simulated time now runs slower",
                self.dropped,
                self.speed,
            )
