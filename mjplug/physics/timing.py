"""Measurements of the loop: how long steps take and how late they start."""

import math
from collections import deque

import numpy as np

_MAX_MEASUREMENTS = 1000
"""Maximum number of measurements kept: enough for a 99th percentile, few enough to evaluate between two steps."""


class Timing:
    """Measurements since the last `take`. Physics thread only.

    The loop writes the attributes directly at every batch of steps, because a method call would cost more.

    Attributes:
        busy: Wall time spent on steps and on the updates before them [s].
        step_times: Latest wall times of a step, averaged over its batch [s].
        lateness: Latest delays between the deadline of a step and its start [s]; empty at speed `max`.
    """

    __slots__ = ("busy", "lateness", "step_times")

    def __init__(self) -> None:
        self.busy = 0.0
        self.step_times: deque[float] = deque(maxlen=_MAX_MEASUREMENTS)
        self.lateness: deque[float] = deque(maxlen=_MAX_MEASUREMENTS)

    def take(self) -> "Timing":
        """Returns the measurements and starts a new period."""
        taken = Timing()
        taken.busy, self.busy = self.busy, 0.0
        taken.step_times, self.step_times = self.step_times, taken.step_times
        taken.lateness, self.lateness = self.lateness, taken.lateness
        return taken


def percentiles(values: deque[float], *percents: float) -> list[float]:
    """Returns the nearest-rank percentile of `values` for each of `percents`; 0.0 if there are no values."""
    if not values:
        return [0.0] * len(percents)
    ranks = [max(0, math.ceil(len(values) * percent / 100.0) - 1) for percent in percents]
    # This runs between two steps, and `partition` is much faster than sorting.
    ordered = np.partition(np.fromiter(values, np.float64, len(values)), ranks)
    return [float(ordered[rank]) for rank in ranks]
