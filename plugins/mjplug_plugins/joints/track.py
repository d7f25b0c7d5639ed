"""A motion that is being executed, and, for a goal of an action, its tolerances and how it ended."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.plugin import Event
from mjplug_plugins.joints.outputs import Coordinate, Drive
from mjplug_plugins.joints.plan import SECOND
from mjplug_plugins.joints.tolerances import Limits, Tolerances
from mjplug_plugins.joints.trajectory import Motion
from mjplug_schemas.control_msgs_action import FollowJointTrajectory

Array = NDArray[np.float64]

Result = FollowJointTrajectory.Result


@dataclass(slots=True)
class Ending:
    """How the motion of a goal ended.

    Attributes:
        event: Set at the end.
        result: The result.
    """

    event: Event = field(default_factory=Event)
    result: Result = field(default_factory=Result)


@dataclass(slots=True, eq=False)
class Track:
    """A motion, and the joints that it moves with their indices in the motion.

    Attributes:
        motion: The motion.
        drives: The joints, with their indices in the motion. It becomes empty at the end.
        tolerances: The tolerances of a goal; None for a motion that only has to be executed.
        ending: How it ended; only for a goal.
        joints: The joints in the order of their indices; all joints of a goal stay until its end.
    """

    motion: Motion
    drives: dict[Drive, int]
    tolerances: Tolerances | None = None
    ending: Ending = field(default_factory=Ending)
    joints: list[Coordinate] = field(init=False)

    def __post_init__(self) -> None:
        self.joints = [drive.joint for drive in sorted(self.drives, key=self.drives.__getitem__)]

    @property
    def names(self) -> list[str]:
        """The names of `joints`."""
        return [joint.name for joint in self.joints]

    def state(self, data: mujoco.MjData) -> Array:
        """Returns position and velocity of `joints`, shape (2, n)."""
        return np.array([[j.position(data) for j in self.joints], [j.velocity(data) for j in self.joints]])

    def desired(self, now: int) -> Array:
        """Returns position and velocity of the setpoints, shape (2, n).

        Args:
            now: Simulated time, not before that of an earlier call [ns].
        """
        positions = self.motion.at(now)
        return np.stack([positions, self.motion.velocity_at(now)])

    def verdict(self, now: int, positions: Sequence[float], data: mujoco.MjData) -> Result | None:
        """Returns the result of a goal if it has been reached or has failed, otherwise None.

        Args:
            now: Simulated time [ns].
            positions: The setpoints of `joints` at this time [rad or m].
            data: The state.
        """
        tolerances = self.tolerances
        assert tolerances is not None
        late = now - self.motion.end
        if late < 0:
            if wrong := self._violation(tolerances.path, now, positions, data):
                return Result(error_code=Result.PATH_TOLERANCE_VIOLATED, error_string=f"path tolerance: {wrong}")
            return None
        wrong = self._violation(tolerances.goal, now, positions, data)
        if not wrong:
            return Result(error_code=Result.SUCCESSFUL, error_string="Goal successfully reached!")
        if tolerances.goal_time and late > tolerances.goal_time:
            return Result(
                error_code=Result.GOAL_TOLERANCE_VIOLATED,
                error_string=f"goal tolerance, {late / SECOND:.3f} s after the last point: {wrong}",
            )
        return None

    def _violation(self, limits: Limits, now: int, positions: Sequence[float], data: mujoco.MjData) -> str:
        """Returns which joint violates which limit, and by how much; empty if none does."""
        # Single numbers, because for few joints, arrays take longer at every step.
        joints = self.joints
        for index, limit in limits.position:
            error = abs(positions[index] - joints[index].position(data))
            if not error <= limit:
                return _sentence(joints[index], "position", error, "rad or m", limit)
        if limits.velocity:
            velocities = self.motion.velocity_at(now).tolist()
            for index, limit in limits.velocity:
                error = abs(velocities[index] - joints[index].velocity(data))
                if not error <= limit:
                    return _sentence(joints[index], "velocity", error, "rad/s or m/s", limit)
        return ""

    def end(self, result: Result) -> None:
        """Ends the motion; what waits for its end gets the result."""
        self.drives.clear()
        self.ending.result = result
        self.ending.event.set()


def _sentence(joint: Coordinate, quantity: str, error: float, unit: str, limit: float) -> str:
    return f"joint {joint.name}: the {quantity} error is {error:.4g} {unit}, the tolerance {limit:.4g}"
