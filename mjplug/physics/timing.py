"""How long steps take and how late they begin, as the loop measures it on its way."""

import math
from collections import deque

import numpy as np

_LATEST = 1000
"""How many measurements are kept: enough for a 99th percentile, few enough to look at between two steps."""


class Timing:
    """Measurements since they were last taken out. Physics thread only.

    The loop writes here at every batch of steps, so it does so without calls.

    Attributes:
        busy: Wall time spent on steps, with the updates before them [s].
        step_times: Wall time of a step, the mean of its batch [s]; the latest ones.
        lateness: How long after its deadline a step began [s]; the latest ones. Nothing at speed `max`.
    """

    __slots__ = ("busy", "lateness", "step_times")

    def __init__(self) -> None:
        self.busy = 0.0
        self.step_times: deque[float] = deque(maxlen=_LATEST)
        self.lateness: deque[float] = deque(maxlen=_LATEST)

    def take(self) -> "Timing":
        """Returns what there is, and begins anew."""
        taken = Timing()
        taken.busy, self.busy = self.busy, 0.0
        taken.step_times, self.step_times = self.step_times, taken.step_times
        taken.lateness, self.lateness = self.lateness, taken.lateness
        return taken


def percentiles(values: deque[float], *percents: float) -> list[float]:
    """Returns, for each percentage, the smallest value that so many percent of them do not exceed; 0 without values."""
    if not values:
        return [0.0] * len(percents)
    ranks = [max(0, math.ceil(len(values) * percent / 100.0) - 1) for percent in percents]
    # Far quicker than to sort: this happens between two steps.
    ordered = np.partition(np.fromiter(values, np.float64, len(values)), ranks)
    return [float(ordered[rank]) for rank in ranks]
