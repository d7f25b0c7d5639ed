"""Tolerances of a trajectory, with the rules of joint_trajectory_controller."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mjplug.plugin import RequestError
from mjplug.plugin.bundled import quoted
from mjplug_plugins.joints.parameters import Constraints
from mjplug_plugins.joints.plan import SECOND, ns
from mjplug_schemas.control_msgs import JointTolerance
from mjplug_schemas.control_msgs_action import FollowJointTrajectory

Pairs = tuple[tuple[int, float], ...]

_ERASED = -1.0
"""A tolerance with this value is not checked, even if the server has a default."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Largest errors of joints, without those that are not checked: pairs of the joint's index and the limit.

    Attributes:
        position: Of positions [rad or m].
        velocity: Of velocities [rad/s or m/s].
    """

    position: Pairs
    velocity: Pairs

    @classmethod
    def of(cls, values: Sequence[Sequence[float]]) -> "Limits":
        """Returns the limits in two rows of numbers, of positions and of velocities; zero means no limit."""
        position, velocity = (tuple((index, limit) for index, limit in enumerate(row) if limit) for row in values)
        return cls(position, velocity)

    @classmethod
    def restored(cls, saved: Sequence[Sequence[Sequence[float]]], width: int) -> "Limits":
        """Returns the limits in what was saved.

        Raises:
            RequestError: The data are invalid.
        """
        position, velocity = (tuple((int(index), float(limit)) for index, limit in pairs) for pairs in saved)
        if not all(0 <= index < width and limit > 0.0 for index, limit in (*position, *velocity)):
            raise RequestError("the tolerances of a trajectory are invalid")
        return cls(position, velocity)


@dataclass(frozen=True, slots=True)
class Tolerances:
    """How much the joints may differ from their setpoints.

    Attributes:
        path: The limits during the motion.
        goal: The limits after the last point.
        goal_time: How long after the last point the goal may be reached [ns]; 0 means without limit.
    """

    path: Limits
    goal: Limits
    goal_time: int

    def save(self) -> dict[str, Any]:
        """Returns the tolerances as data."""
        path, goal = ([limits.position, limits.velocity] for limits in (self.path, self.goal))
        return {"path": path, "goal": goal, "goal_time": self.goal_time}

    @classmethod
    def restored(cls, saved: Mapping[str, Any], width: int) -> "Tolerances":
        """Returns the tolerances in what `save` has returned.

        Raises:
            RequestError: The data are invalid.
        """
        goal_time = int(saved["goal_time"])
        if goal_time < 0:
            raise RequestError("the tolerances of a trajectory are invalid")
        return cls(Limits.restored(saved["path"], width), Limits.restored(saved["goal"], width), goal_time)


def tolerances_of(request: FollowJointTrajectory.Goal, defaults: Constraints) -> Tolerances:
    """Returns the tolerances of a goal.

    Args:
        request: The goal.
        defaults: The tolerances where the goal contains none.

    Raises:
        RequestError: A tolerance is invalid; the message says which.
    """
    names = request.trajectory.joint_names
    path = [[defaults.trajectory.get(name, 0.0) for name in names], [0.0] * len(names)]
    goal = [[defaults.goal.get(name, 0.0) for name in names], [defaults.stopped_velocity_tolerance] * len(names)]
    _replace(path, "path_tolerance", request.path_tolerance, names)
    _replace(goal, "goal_tolerance", request.goal_tolerance, names)
    seconds = ns(request.goal_time_tolerance) / SECOND
    time = _chosen(seconds, defaults.goal_time, "goal_time_tolerance")
    return Tolerances(Limits.of(path), Limits.of(goal), round(time * SECOND))


def _replace(values: list[list[float]], field: str, given: Iterable[JointTolerance], names: Sequence[str]) -> None:
    for index, tolerance in enumerate(given):
        where = f"{field}[{index}]"
        if tolerance.name not in names:
            raise RequestError(f"{where}: joint {quoted(tolerance.name)} is not in the trajectory")
        if tolerance.acceleration > 0.0:
            raise RequestError(f"{where}.acceleration is {tolerance.acceleration:g}; accelerations are not checked")
        column = names.index(tolerance.name)
        for row, name in enumerate(("position", "velocity")):
            values[row][column] = _chosen(getattr(tolerance, name), values[row][column], f"{where}.{name}")


def _chosen(value: float, default: float, where: str) -> float:
    if value == _ERASED:
        return 0.0
    if not (0.0 <= value < float("inf")):
        raise RequestError(f"{where} is {value:g}; it must be positive, 0 for the default, or -1 for no tolerance")
    return value or default
