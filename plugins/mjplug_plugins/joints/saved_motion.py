"""A motion as arrays of a saved state."""

from collections.abc import Mapping, Sequence
from math import isnan

import numpy as np
from numpy.typing import NDArray

from mjplug.plugin import RequestError
from mjplug_plugins.joints.trajectory import Motion
from mjplug_schemas.trajectory_msgs import JointTrajectoryPoint

Array = NDArray[np.float64]

_DERIVATIVES = ("velocities", "accelerations")

_MAX_TIME = 1 << 62
"""Limit of times before and after now [ns]."""


def motion_arrays(motion: Motion, now: int) -> dict[str, NDArray[np.generic]]:
    """Returns the points of a motion.

    Args:
        motion: The motion.
        now: Simulated time [ns].

    Returns:
        `times` relative to `now`, shape (k,) [ns]; `positions`, `velocities` and `accelerations`, shape (k, n), NaN
        where a point has none.
    """
    points, width = motion.points, len(motion.points[0].positions)
    arrays: dict[str, NDArray[np.generic]] = {
        "times": np.array([time - now for time in motion.times], np.int64),
        "positions": _rows([point.positions for point in points], width),
    }
    return arrays | {name: _rows([getattr(point, name) for point in points], width) for name in _DERIVATIVES}


def motion_of(arrays: Mapping[str, NDArray[np.generic]], now: int, ended: bool = False) -> Motion:
    """Returns the motion in what `motion_arrays` has returned.

    Args:
        arrays: The arrays.
        now: Simulated time [ns].
        ended: Whether its last point may be past.

    Raises:
        RequestError: The arrays are invalid.
    """
    times, positions = arrays["times"], arrays["positions"]
    rows = [arrays[name] for name in _DERIVATIVES]
    valid = times.dtype == np.int64 and times.ndim == 1 and positions.ndim == 2 and len(times) == len(positions) >= 2
    valid = valid and positions.dtype == np.float64 and bool(np.isfinite(positions).all())
    valid = valid and all(row.shape == positions.shape and row.dtype == np.float64 for row in rows)
    # The trajectory itself begins after the start, or at it.
    valid = valid and all(-_MAX_TIME < time < _MAX_TIME for time in times.tolist())
    if not valid or (np.diff(times[1:]) <= 0).any() or (times[-1] < 0 and not ended):
        raise RequestError("a trajectory is invalid")
    points = [
        JointTrajectoryPoint(positions=row, velocities=_given(velocities), accelerations=_given(accelerations))
        for row, velocities, accelerations in zip(positions.tolist(), *(row.tolist() for row in rows), strict=True)
    ]
    return Motion.resumed([now + time for time in times.tolist()], points)


def _rows(values: Sequence[Sequence[float]], width: int) -> Array:
    return np.array([row or (np.nan,) * width for row in values], np.float64).reshape(len(values), width)


def _given(row: Sequence[float]) -> Sequence[float]:
    return () if any(map(isnan, row)) else row
