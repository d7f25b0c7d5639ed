"""The actions GripperCommand and ParallelGripperCommand, as gripper controllers of ros2_controllers serve them."""

from collections.abc import Callable
from functools import partial
from math import isfinite
from typing import Any

from mjplug.plugin import Goal, GoalCanceled, GoalRun, Host, PluginError, RequestError
from mjplug.plugin.bundled import quoted
from mjplug_plugins.joints.outputs import MAX_VALUE, Drive
from mjplug_plugins.joints.parameters import Gripper
from mjplug_plugins.joints.plan import SECOND
from mjplug_plugins.joints.scalar_joint import ScalarJoint
from mjplug_plugins.joints.trajectories import Trajectories
from mjplug_schemas.control_msgs_action import GripperCommand, ParallelGripperCommand
from mjplug_schemas.message import Message
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.std_msgs import Header

CHECK_PERIOD = SECOND // 100
"""Simulated time between two checks of a goal [ns]; the default update rate of ros2_control."""

FEEDBACK_CHECKS = 5
"""Number of checks between two feedback messages."""


class GripperAction:
    """Moves one joint to the position of a goal, until it is reached or something stops the joint.

    The command is an ordinary position command, which is part of the saved state; the goal only reports what happens.

    Args:
        host: The plugin's interface to the server.
        name: Name of the gripper in the configuration.
        gripper: Its configuration.
        drive: Its joint.
        trajectories: The running trajectories; a goal removes the joint from its trajectory.
        wake: Called after the joint got a command.

    Raises:
        PluginError: The joint does not accept position commands, or is derived by a transmission.
    """

    def __init__(
        self,
        host: Host,
        name: str,
        gripper: Gripper,
        drive: Drive,
        trajectories: Trajectories,
        wake: Callable[[], None],
    ) -> None:
        if "position" not in drive.outputs:
            raise PluginError(
                f"gripper {name!r}: joint {drive.joint.name!r} accepts {drive.accepted} commands, not position"
            )
        if not isinstance(drive.joint, ScalarJoint):
            raise PluginError(f"gripper {name!r}: {drive.joint.name!r} is no joint of the model, but of a transmission")
        self._host, self._gripper, self._drive = host, gripper, drive
        self._joint = drive.joint
        self._trajectories, self._wake = trajectories, wake
        self._current: Goal | None = None
        self._period = max(1, host.steps_covering(CHECK_PERIOD))
        self._report: Callable[..., Message] = _report if gripper.type == "GripperCommand" else _parallel_report
        action = GripperCommand if gripper.type == "GripperCommand" else ParallelGripperCommand
        target = _position if gripper.type == "GripperCommand" else partial(_parallel_position, drive.joint.name)
        host.create_action(action, gripper.action or f"{name}/gripper_cmd", self._move, prepare=target)

    def _move(self, target: float, goal: Goal) -> GoalRun:
        host, joint, limits = self._host, self._joint, self._gripper
        self._current = goal
        self._command(target)
        moved_at, checks = host.time_ns, 0
        try:
            while True:
                yield host.step + self._period
                if self._current is not goal or self._drive.desired != target:
                    return goal.aborted(self._state("Result", stalled=False, reached=False))
                if abs(target - joint.position(host.data)) < limits.goal_tolerance:
                    return self._state("Result", stalled=False, reached=True)
                if abs(joint.velocity(host.data)) > limits.stall_velocity_threshold:
                    moved_at = host.time_ns
                elif host.time_ns - moved_at > limits.stall_timeout * SECOND:
                    result = self._state("Result", stalled=True, reached=False)
                    return result if limits.allow_stalling else goal.aborted(result)
                checks += 1
                if checks % FEEDBACK_CHECKS == 0 and goal.observed:
                    goal.feedback(self._state("Feedback", stalled=False, reached=False))
        except GoalCanceled:
            self._command(joint.position(host.data))
            return goal.canceled(self._state("Result", stalled=False, reached=False))
        finally:
            if self._current is goal:
                self._current = None

    def _command(self, position: float) -> None:
        self._trajectories.drop(self._drive)
        self._drive.command("position", position)
        self._wake()

    def _state(self, part: str, stalled: bool, reached: bool) -> Message:
        joint, host = self._joint, self._host
        effort = float(host.data.qfrc_actuator[joint.dof])
        state = joint.position(host.data), joint.velocity(host.data), effort
        return self._report(part, joint.name, host.now(), *state, stalled, reached)


def _position(request: GripperCommand.Goal) -> float:
    return _checked(request.command.position, "command.position")


def _parallel_position(joint: str, request: ParallelGripperCommand.Goal) -> float:
    command = request.command
    if len(command.position) != 1:
        raise RequestError(f"command.position contains {len(command.position)} numbers; it must contain one")
    if command.name not in ((), (joint,)):
        raise RequestError(f"command.name is {quoted(', '.join(command.name))}; the joint is {joint!r}")
    return _checked(command.position[0], "command.position[0]")


def _checked(position: float, where: str) -> float:
    if not (isfinite(position) and abs(position) <= MAX_VALUE):
        raise RequestError(f"{where} is {position:g}; it must be finite and below {MAX_VALUE:g}")
    return position


def _report(
    part: str, joint: str, stamp: Any, position: float, velocity: float, effort: float, stalled: bool, reached: bool
) -> Message:
    kind = GripperCommand.Result if part == "Result" else GripperCommand.Feedback
    return kind(position=position, effort=effort, stalled=stalled, reached_goal=reached)


def _parallel_report(
    part: str, joint: str, stamp: Any, position: float, velocity: float, effort: float, stalled: bool, reached: bool
) -> Message:
    state = JointState(
        header=Header(stamp=stamp), name=(joint,), position=(position,), velocity=(velocity,), effort=(effort,)
    )
    if part == "Feedback":
        return ParallelGripperCommand.Feedback(state=state)
    return ParallelGripperCommand.Result(state=state, stalled=stalled, reached_goal=reached)
