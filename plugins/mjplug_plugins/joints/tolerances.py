"""Tolerances of a trajectory, with the rules of joint_trajectory_controller."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mjplug.plugin import RequestError
from mjplug.plugin.bundled import quoted
from mjplug_plugins.joints.outputs import Coordinate
from mjplug_plugins.joints.parameters import Constraints
from mjplug_plugins.joints.plan import SECOND, ns
from mjplug_schemas.control_msgs import JointTolerance
from mjplug_schemas.control_msgs_action import FollowJointTrajectory

Array = NDArray[np.float64]

_ERASED = -1.0
"""A tolerance with this value is not checked, even if the server has a default."""

_UNITS = ("rad or m", "rad/s or m/s")


@dataclass(frozen=True, slots=True)
class Tolerances:
    """How much the joints may differ from their setpoints; zero means that nothing is checked.

    Attributes:
        path: Tolerances of position and velocity during the motion, shape (2, n) [rad or m, rad/s or m/s].
        goal: The same after the last point.
        goal_time: How long after the last point the goal may be reached [ns]; 0 means without limit.
    """

    path: Array
    goal: Array
    goal_time: int

    def save(self) -> dict[str, Any]:
        """Returns the tolerances as data."""
        return {"path": self.path.tolist(), "goal": self.goal.tolist(), "goal_time": self.goal_time}

    @classmethod
    def restored(cls, saved: Mapping[str, Any], width: int) -> "Tolerances":
        """Returns the tolerances in what `save` has returned.

        Raises:
            RequestError: The data are invalid.
        """
        path, goal, goal_time = np.array(saved["path"], float), np.array(saved["goal"], float), int(saved["goal_time"])
        valid = all(part.shape == (2, width) and (part >= 0.0).all() for part in (path, goal))
        if not valid or goal_time < 0:
            raise RequestError("the tolerances of a trajectory are invalid")
        return cls(path, goal, goal_time)


def tolerances_of(request: FollowJointTrajectory.Goal, defaults: Constraints) -> Tolerances:
    """Returns the tolerances of a goal.

    Args:
        request: The goal.
        defaults: The tolerances where the goal contains none.

    Raises:
        RequestError: A tolerance is invalid; the message says which.
    """
    names = request.trajectory.joint_names
    path, goal = np.zeros((2, len(names))), np.zeros((2, len(names)))
    path[0] = [defaults.trajectory.get(name, 0.0) for name in names]
    goal[0] = [defaults.goal.get(name, 0.0) for name in names]
    goal[1] = defaults.stopped_velocity_tolerance
    _replace(path, "path_tolerance", request.path_tolerance, names)
    _replace(goal, "goal_tolerance", request.goal_tolerance, names)
    seconds = ns(request.goal_time_tolerance) / SECOND
    time = _chosen(seconds, defaults.goal_time, "goal_time_tolerance")
    return Tolerances(path, goal, round(time * SECOND))


def _replace(values: Array, field: str, given: Iterable[JointTolerance], names: Sequence[str]) -> None:
    for index, tolerance in enumerate(given):
        where = f"{field}[{index}]"
        if tolerance.name not in names:
            raise RequestError(f"{where}: joint {quoted(tolerance.name)} is not in the trajectory")
        if tolerance.acceleration > 0.0:
            raise RequestError(f"{where}.acceleration is {tolerance.acceleration:g}; accelerations are not checked")
        column = names.index(tolerance.name)
        for row, name in enumerate(("position", "velocity")):
            values[row, column] = _chosen(getattr(tolerance, name), float(values[row, column]), f"{where}.{name}")


def _chosen(value: float, default: float, where: str) -> float:
    if value == _ERASED:
        return 0.0
    if not (0.0 <= value < float("inf")):
        raise RequestError(f"{where} is {value:g}; it must be positive, 0 for the default, or -1 for no tolerance")
    return value or default


def violation(joints: Sequence[Coordinate], error: Array, tolerance: Array) -> str:
    """Returns which joint violates which tolerance, and by how much; empty if none does.

    Args:
        joints: The joints.
        error: Setpoints minus state, position and velocity, shape (2, n).
        tolerance: `Tolerances.path` or `Tolerances.goal`.
    """
    violated = (tolerance > 0.0) & (np.abs(error) > tolerance)
    if not violated.any():
        return ""
    row, column = (int(index) for index in np.argwhere(violated)[0])
    quantity, unit = ("position", "velocity")[row], _UNITS[row]
    return (
        f"joint {joints[column].name}: the {quantity} error is {abs(error[row, column]):.4g} {unit}, "
        f"the tolerance {tolerance[row, column]:.4g}"
    )
