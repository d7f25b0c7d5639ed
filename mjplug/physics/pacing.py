"""Paces simulated time by the wall clock, with absolute deadlines."""

import logging
from typing import Literal

from mjplug.physics.step_time import StepTime
from mjplug.throttle import Throttle

MAX_LAG = 0.1
"""Maximum lag that is caught up [s of wall time]; lag beyond it is dropped."""

MIN_WAKE_INTERVAL = 0.001
"""Minimum wall time between two wake-ups of the loop for steps alone [s]; shorter steps are taken in groups."""

MIN_STALL = 2.0
"""Minimum lag dropped at once that is reported as a stall of the process instead of slow steps [s]."""

REPORT_INTERVAL = 10.0
"""Minimum wall time between two log lines about lag [s]."""

_log = logging.getLogger(__name__)

Speed = float | Literal["max"]


class Pacer:
    """Computes which step is due at which wall time.

    Deadlines count from an anchor, so rounding errors do not accumulate. The anchor moves only when the speed changes,
    after a pause or a reset, and when lag is dropped.

    Attributes:
        speed: Real-time factor, or `max` for no pacing.
        dropped: Total lag dropped since the start [s of wall time].
        drops: How often lag was dropped.

    Args:
        time: Conversion between steps and simulated time.
        speed: Real-time factor from `limits.MIN_SPEED` to `limits.MAX_SPEED`, or `max`.
    """

    def __init__(self, time: StepTime, speed: Speed) -> None:
        self.speed = speed
        self.dropped = 0.0
        self.drops = 0
        self._timestep = float(time.timestep)
        self._anchor_step = 0
        self._anchor = 0.0
        self._too_slow, self._did_not_run = Throttle(REPORT_INTERVAL), Throttle(REPORT_INTERVAL)

    @property
    def period(self) -> float:
        """Wall time of one step [s]; 0 at speed `max`."""
        return 0.0 if self.speed == "max" else self._timestep / self.speed

    @property
    def steps_per_wake(self) -> int:
        """Number of steps in about `MIN_WAKE_INTERVAL`. If nothing else is due, the loop wakes up once for all."""
        return max(1, int(MIN_WAKE_INTERVAL / self.period))

    def anchor(self, step: int, now: float) -> None:
        """Makes `step` due at the wall time `now` [s]."""
        self._anchor_step, self._anchor = step, now

    def deadline(self, step: int) -> float:
        """Returns the wall time at which `step` is due [s]."""
        return self._anchor + (step - self._anchor_step) * self.period

    def due(self, step: int, now: float) -> int:
        """Returns the step that is due at the wall time `now`; drops and reports lag beyond `MAX_LAG`.

        Args:
            step: Steps taken so far.
            now: Wall time [s].
        """
        lag = now - self.deadline(step)
        excess = lag - MAX_LAG - self.period
        if excess > 0.0:
            self.dropped += excess
            self.drops += 1
            self._report(now, excess)
            self._anchor += excess
            lag -= excess
        return step + max(0, int(lag / self.period + 1e-6))

    def _report(self, now: float, excess: float) -> None:
        if excess >= MIN_STALL:
            if self._did_not_run.admit(now):
                _log.warning(
                    "no step was taken for %.1f s of wall time: the process or the machine was suspended, a call "
                    "blocked the physics thread, or a lockstep worker was slow; simulated time continues where it "
                    "was%s",
                    excess,
                    self._did_not_run.suppressed(),
                )
        elif self._too_slow.admit(now):
            _log.warning(
                "physics cannot keep up: %s s of wall time lost so far at speed %g; simulated time now runs slower",
                # Little at first, and then more and more.
                f"{self.dropped:.2g}" if self.dropped < 10.0 else f"{self.dropped:.0f}",
                self.speed,
            )
