"""Validates requests that set the state of free bodies. All entries are checked before any is applied."""

from collections.abc import Iterable

from mjplug.errors import RequestError, UnknownName, quoted
from mjplug.physics.free_joint import FreeJointTarget
from mjplug.physics.simulation import Simulation
from mjplug.services.geometry import unit_quat_wxyz, vector
from mjplug_schemas.mujoco_ros2_control_msgs import FreeJointState


def validate(simulation: Simulation, states: Iterable[FreeJointState]) -> list[FreeJointTarget]:
    """Checks every entry and returns the targets to apply, in the order of the entries.

    Raises:
        RequestError: An entry is invalid; the message contains its index, its name and the reason.
    """
    targets: list[FreeJointTarget] = []
    first: dict[int, int] = {}
    for index, state in enumerate(states):
        try:
            target = _target(simulation, state)
        except RequestError as error:
            raise RequestError(f"free_joints[{index}] ({quoted(state.name)}): {error}") from None
        if target.body in first:
            raise RequestError(
                f"free_joints[{index}] ({quoted(state.name)}): duplicate of free_joints[{first[target.body]}]; "
                "list each body once"
            )
        first[target.body] = index
        targets.append(target)
    return targets


def _target(simulation: Simulation, state: FreeJointState) -> FreeJointTarget:
    try:
        body = simulation.body_id(state.name)
    except UnknownName:
        raise UnknownName("body with a free joint", state.name, simulation.free_bodies) from None
    if body not in simulation.free_joints:
        raise RequestError(f"body {state.name!r} has no free joint")
    pose, twist = state.pose.pose, state.twist.twist
    return FreeJointTarget(
        body=body,
        joint=simulation.free_joints[body],
        pose_frame=_frame(simulation, "pose", state.pose.header.frame_id),
        pos=vector(pose.position, "pose.pose.position"),
        quat_wxyz=unit_quat_wxyz(pose.orientation, "pose.pose.orientation"),
        twist_frame=_frame(simulation, "twist", state.twist.header.frame_id),
        linear=vector(twist.linear, "twist.twist.linear"),
        angular=vector(twist.angular, "twist.twist.angular"),
    )


def _frame(simulation: Simulation, part: str, name: str) -> int:
    if not name:
        return 0
    try:
        return simulation.body_id(name)
    except UnknownName as error:
        raise RequestError(f"{part}.header.frame_id: {error}") from None
