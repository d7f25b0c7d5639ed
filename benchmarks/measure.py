"""Medians and ranges of pairs that are measured alternately, so that ratios do not depend on the machine's speed."""

import statistics
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Result:
    """One row of the table.

    Attributes:
        what: Name of the measurement.
        ours: Median of mjplug, with its unit.
        other: Median of the reference, with its unit; empty without a reference.
        ratio: Median of the ratios of the pairs; without a reference, the measured value.
        low: Smallest ratio.
        high: Largest ratio.
        goal: Goal for the ratio, such as `>= 0.95`.
    """

    what: str
    ours: str
    other: str
    ratio: float
    low: float
    high: float
    goal: str

    @property
    def met(self) -> bool:
        """Whether the median reaches the goal."""
        sign, limit = self.goal.split()[:2]
        return self.ratio >= float(limit) if sign == ">=" else self.ratio <= float(limit)


def pairs(
    what: str,
    ours: Callable[[], float],
    other: Callable[[], float],
    goal: str,
    unit: str,
    repeats: int = 7,
) -> Result:
    """Measures two functions alternately, after one warm-up of each, and returns their ratio.

    Args:
        what: Name of the row.
        ours: Returns one measurement.
        other: Returns one measurement of the reference, in the same unit.
        goal: Goal for the ratio.
        unit: Format of one measurement, such as `{:.0f} steps/s`.
        repeats: Number of pairs.
    """
    ours(), other()
    measured = [(ours(), other()) for _ in range(repeats)]
    ratios = [a / b for a, b in measured]
    medians = [statistics.median(column) for column in zip(*measured, strict=True)]
    shown = [unit.format(value) for value in medians]
    return Result(what, *shown, statistics.median(ratios), min(ratios), max(ratios), goal)


def figure(what: str, measure: Callable[[], float], goal: str, unit: str, repeats: int = 7) -> Result:
    """Measures one function several times and returns the median."""
    measure()
    values = [measure() for _ in range(repeats)]
    median = statistics.median(values)
    return Result(what, unit.format(median), "", median, min(values), max(values), goal)
