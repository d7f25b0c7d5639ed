"""The action control_msgs/action/FollowJointTrajectory, as joint_trajectory_controller serves it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mjplug.plugin import Goal, GoalCanceled, GoalRun, Host, RequestError
from mjplug_plugins.joints.parameters import Constraints
from mjplug_plugins.joints.plan import SECOND
from mjplug_plugins.joints.tolerances import Tolerances, tolerances_of
from mjplug_plugins.joints.track import Result, Track
from mjplug_plugins.joints.trajectories import Command, Trajectories
from mjplug_schemas.builtin_interfaces import Duration
from mjplug_schemas.control_msgs_action import FollowJointTrajectory
from mjplug_schemas.std_msgs import Header
from mjplug_schemas.trajectory_msgs import JointTrajectoryPoint

FEEDBACK_PERIOD = SECOND // 20
"""Simulated time between two feedback messages of a goal [ns]; the default of joint_trajectory_controller."""


@dataclass(frozen=True, slots=True)
class Accepted:
    """A checked goal.

    Attributes:
        command: Its trajectory.
        tolerances: Its tolerances.
    """

    command: Command
    tolerances: Tolerances


class FollowJointTrajectoryAction:
    """Executes goals. What happens to the joints is part of the trajectories and their saved state; this reports it.

    Args:
        host: The plugin's interface to the server.
        name: Name of the action.
        trajectories: Executes the trajectories.
        constraints: Tolerances where a goal contains none.
        wake: Called after a trajectory was started.
    """

    def __init__(
        self, host: Host, name: str, trajectories: Trajectories, constraints: Constraints, wake: Callable[[], None]
    ) -> None:
        self._host = host
        self._trajectories = trajectories
        self._constraints = constraints
        self._wake = wake
        self._under_way: dict[Goal, Track] = {}
        self._period = max(1, host.steps_covering(FEEDBACK_PERIOD))
        self._alarm = host.create_alarm(self._feed_back)
        host.create_action(FollowJointTrajectory, name, self._follow, on_abort=_aborted, prepare=self._checked)

    def _checked(self, request: FollowJointTrajectory.Goal) -> Accepted:
        """Checks a goal, on the transport's thread."""
        if request.multi_dof_trajectory.points or request.multi_dof_trajectory.joint_names:
            raise RequestError("multi_dof_trajectory must be empty: only hinges and slides can follow trajectories")
        if request.component_path_tolerance or request.component_goal_tolerance:
            raise RequestError("component tolerances must be empty: only hinges and slides can follow trajectories")
        command = self._trajectories.checked(request.trajectory)
        if not command.plan.points:
            raise RequestError("the trajectory has no points; cancel the goal to stop the joints")
        return Accepted(command, tolerances_of(request, self._constraints))

    def _follow(self, accepted: Accepted, goal: Goal) -> GoalRun:
        track = self._trajectories.start(accepted.command, accepted.tolerances)
        assert track is not None
        self._wake()
        if not self._under_way:
            self._alarm.set(self._host.step + self._period)
        self._under_way[goal] = track
        try:
            yield track.ending.event
        except GoalCanceled:
            self._trajectories.hold(track, Result())
            return goal.canceled(Result(error_string="a client cancelled the goal; the joints hold their positions"))
        finally:
            del self._under_way[goal]
        result = track.ending.result
        return goal.aborted(result) if result.error_code else result

    def _feed_back(self) -> None:
        """Publishes feedback about all goals, and sets the alarm again."""
        now, data = self._host.time_ns, self._host.data
        for goal, track in self._under_way.items():
            if not (goal.observed and track.drives):
                continue
            desired, actual = track.desired(now), track.state(data)
            elapsed = Duration.from_ns(now - track.motion.begin)
            goal.feedback(
                FollowJointTrajectory.Feedback(
                    header=Header(stamp=self._host.now()),
                    joint_names=tuple(track.names),
                    desired=_point(desired, elapsed),
                    actual=_point(actual, elapsed),
                    error=_point(desired - actual, elapsed),
                )
            )
        if self._under_way:
            self._alarm.set(self._host.step + self._period)


def _point(values: NDArray[np.float64], elapsed: Duration) -> JointTrajectoryPoint:
    positions, velocities = values.tolist()
    return JointTrajectoryPoint(positions=tuple(positions), velocities=tuple(velocities), time_from_start=elapsed)


def _aborted(reason: str) -> Result:
    return Result(error_code=Result.INVALID_GOAL, error_string=reason)
