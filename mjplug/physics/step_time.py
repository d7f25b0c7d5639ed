"""Exact simulated time: an integer number of steps times a rational time step [s]."""

from fractions import Fraction

_NS = 1_000_000_000


def as_fraction(seconds: float) -> Fraction:
    """Returns a simple fraction close to a float, such as 1/240 for 0.004166666666666667.

    The result is a fraction with a denominator up to 10⁶ if its relative error is at most 1e-10, otherwise the decimal
    fraction that `repr` shows.

    Args:
        seconds: A finite duration [s].
    """
    exact = Fraction(seconds)
    for simple in (exact.limit_denominator(1_000_000), Fraction(repr(seconds))):
        if simple and abs(simple - exact) <= abs(exact) * Fraction(1, 10**10):
            return simple
    return exact


class StepTime:
    """Converts between step numbers and simulated time without accumulating rounding errors.

    Args:
        timestep: MuJoCo's `opt.timestep` [s], positive.

    Attributes:
        timestep: The time step as a fraction [s].
        origin: The step number at which the time is zero; `restart` changes it.
    """

    def __init__(self, timestep: float) -> None:
        self.timestep = as_fraction(timestep)
        self.origin = 0
        ns = self.timestep * _NS
        self._num, self._den = ns.numerator, ns.denominator

    def ns(self, step: int) -> int:
        """Returns the simulated time after `step` steps, rounded to the nearest nanosecond [ns]."""
        return (2 * (step - self.origin) * self._num + self._den) // (2 * self._den)

    def restart(self, step: int) -> None:
        """Makes the time zero at `step`."""
        self.origin = step

    def seconds(self, step: int) -> float:
        """Returns the simulated time after `step` steps [s]."""
        return self.ns(step) / _NS

    def steps_covering(self, duration_ns: int) -> int:
        """Returns the smallest number of steps whose total length is at least `duration_ns` [ns]."""
        return -(-duration_ns * self._den // self._num)

    def steps_per(self, period: float) -> Fraction:
        """Returns the number of steps in a period [s]; it need not be whole."""
        return as_fraction(period) / self.timestep
