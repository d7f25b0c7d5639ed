"""Medians with their spread, of pairs measured in turn, so that a drifting machine still gives a fair ratio."""

import statistics
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Result:
    """One line of the table.

    Attributes:
        what: What was measured.
        ours: Median of ours, with its unit.
        other: Median of what it is compared with, with its unit; empty if there is nothing to compare with.
        ratio: Median of ours divided by the other, pair by pair; for a plain figure the figure itself.
        low: Smallest ratio seen.
        high: Largest ratio seen.
        goal: What the ratio should be, such as `>= 0.95`.
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
        """Whether the median keeps to the goal."""
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
    """Measures two things in turn, after one unmeasured turn of each, and returns their ratio.

    Args:
        what: Name of the line.
        ours: Returns one measurement.
        other: Returns one measurement of what it is compared with, in the same unit.
        goal: What the ratio should be.
        unit: Format of one measurement, such as `{:.0f} steps/s`.
        repeats: Counted turns.
    """
    ours(), other()
    measured = [(ours(), other()) for _ in range(repeats)]
    ratios = [a / b for a, b in measured]
    medians = [statistics.median(column) for column in zip(*measured, strict=True)]
    shown = [unit.format(value) for value in medians]
    return Result(what, *shown, statistics.median(ratios), min(ratios), max(ratios), goal)


def figure(what: str, measure: Callable[[], float], goal: str, unit: str, repeats: int = 7) -> Result:
    """Measures one thing several times."""
    measure()
    values = [measure() for _ in range(repeats)]
    median = statistics.median(values)
    return Result(what, unit.format(median), "", median, min(values), max(values), goal)
