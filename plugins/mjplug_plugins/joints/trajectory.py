"""Motions of joints through trajectory points, with the interpolation of joint_trajectory_controller."""

import math
from bisect import bisect_right
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mjplug.plugin.bundled import float_view
from mjplug_plugins.joints.plan import SECOND, Plan
from mjplug_schemas.trajectory_msgs import JointTrajectoryPoint

Array = NDArray[np.float64]


class Motion:
    """The positions of some joints over time.

    The interpolation between two points is linear if one of them has positions only, cubic if both have velocities, and
    quintic if both also have accelerations. The motion starts at the given state and stays at the last point.

    Args:
        plan: The points; at least one.
        begin: Simulated time from which the times of the points count [ns].
        now: Simulated time [ns].
        position: Start positions, in the order of `joint_names`, shape (n,) [rad or m].
        velocity: Start velocities, in the order of `joint_names`, shape (n,) [rad/s or m/s].
    """

    def __init__(self, plan: Plan, begin: int, now: int, position: Array, velocity: Array) -> None:
        start = JointTrajectoryPoint(positions=position.tolist(), velocities=velocity.tolist())
        self._begin(begin, now - begin, start, plan.times, plan.points)

    def _begin(
        self,
        begin: int,
        first_time: int,
        first_point: JointTrajectoryPoint,
        times: Sequence[int],
        points: Sequence[JointTrajectoryPoint],
    ) -> None:
        # Times count from `begin`, and the first point is kept apart, so that nothing of a long plan is copied.
        self._origin = begin
        self._first_time, self._first_point = first_time, first_point
        self._times, self._points = times, points
        self._segment = 0
        self._coefficients = np.empty((0, len(first_point.positions)))
        self._powers = np.ones(1)
        self._each_power = float_view(self._powers)
        self.end = begin + times[-1]

    @classmethod
    def resumed(cls, times: Sequence[int], points: Sequence[JointTrajectoryPoint]) -> "Motion":
        """Returns a motion through points, the first of which is the start.

        Args:
            times: The time of each point [ns].
            points: The points.
        """
        motion = cls.__new__(cls)
        motion._begin(0, times[0], points[0], tuple(times[1:]), tuple(points[1:]))
        return motion

    @property
    def times(self) -> Sequence[int]:
        """The time of each point [ns]."""
        return [self._origin + time for time in (self._first_time, *self._times)]

    @property
    def points(self) -> Sequence[JointTrajectoryPoint]:
        """The points, the first of which is the start."""
        return [self._first_point, *self._points]

    @property
    def begin(self) -> int:
        """Simulated time of the start [ns]."""
        return self._origin + self._first_time

    @property
    def _segment_start(self) -> int:
        return self._times[self._segment - 1] if self._segment else self._first_time

    def at(self, time: int) -> Array:
        """Returns the positions at a time, shape (n,) [rad or m].

        Args:
            time: Simulated time, not before that of the last call [ns].
        """
        if time >= self.end:
            return np.array(self._points[-1].positions, float)
        moved = not len(self._coefficients)
        elapsed = time - self._origin
        if self._times[self._segment] <= elapsed:
            # Segment k ends at the k-th point of the plan.
            self._segment = bisect_right(self._times, elapsed, self._segment)
            moved = True
        if moved:
            self._coefficients = self._polynomial(self._segment)
            self._powers = np.ones(len(self._coefficients))
            self._each_power = float_view(self._powers)
        t, power, powers = (elapsed - self._segment_start) / SECOND, 1.0, self._each_power
        for k in range(1, len(powers)):
            power *= t
            powers[k] = power
        positions: Array = self._powers @ self._coefficients
        return positions

    def velocity_at(self, time: int) -> Array:
        """Returns the velocities at a time, shape (n,) [rad/s or m/s]; call `at` for the same time first."""
        if time >= self.end or not len(self._coefficients):
            return np.zeros(self._coefficients.shape[1])
        t = (time - self._origin - self._segment_start) / SECOND
        velocities = np.zeros(self._coefficients.shape[1])
        for k, coefficient in enumerate(self._coefficients[1:], 1):
            velocities += k * t ** (k - 1) * coefficient
        return velocities

    def _polynomial(self, segment: int) -> Array:
        """Returns the polynomial coefficients of a segment, t⁰ first, shape (k, n) with k = 2, 4 or 6."""
        a = self._points[segment - 1] if segment else self._first_point
        b = self._points[segment]
        seconds = (self._times[segment] - self._segment_start) / SECOND
        x0, x1 = np.array(a.positions, float), np.array(b.positions, float)
        orders = 1
        if a.velocities and b.velocities:
            orders = 3 if a.accelerations and b.accelerations else 2
        if orders == 1:
            return np.stack([x0, (x1 - x0) / seconds])
        v0, v1 = np.array(a.velocities, float), np.array(b.velocities, float)
        if orders == 2:
            return _hermite([x0, v0], [x1, v1], seconds)
        a0, a1 = np.array(a.accelerations, float), np.array(b.accelerations, float)
        return _hermite([x0, v0, a0], [x1, v1, a1], seconds)


def _hermite(begin: Sequence[Array], end: Sequence[Array], seconds: float) -> Array:
    """Returns the coefficients, shape (2 k, n), of the polynomial with the given k derivatives at both ends."""
    orders = len(begin)
    lower = [value / math.factorial(k) for k, value in enumerate(begin)]
    powers = range(orders, 2 * orders)
    matrix, rest = np.empty((orders, orders)), np.empty((orders, len(begin[0])))
    for row in range(orders):
        # In units of the segment's duration, so that the matrix is well conditioned for every duration.
        matrix[row] = [math.perm(k, row) for k in powers]
        known = sum(math.perm(k, row) * seconds ** (k - row) * lower[k] for k in range(row, orders))
        rest[row] = (end[row] - known) * seconds**row
    upper = np.linalg.solve(matrix, rest)
    return np.stack([*lower, *(upper[i] / seconds**k for i, k in enumerate(powers))])
