"""Free joints as messages: pose and twist of a body, in the world or relative to another body.

MuJoCo keeps the linear velocity of a free joint in the world frame and its angular velocity in the body's own frame
(https://mujoco.readthedocs.io/en/stable/overview.html#floating-objects); messages have both in one frame.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from mjplug.core.frames import Array, compose, inverse, rotate, unit_quat_wxyz, vector
from mjplug.core.simulation import Simulation
from mjplug.errors import RequestError, UnknownName, quoted
from mjplug_schemas.mujoco_ros2_control_msgs import FreeJointState


@dataclass(frozen=True, slots=True)
class FreeJointTarget:
    """A valid request to place one free body.

    Attributes:
        body: The body's id.
        joint: Its free joint's id.
        pose_frame: Body id of the frame of `pos` and `quat_wxyz`; 0 is the world.
        pos: Position [m], shape (3,).
        quat_wxyz: Orientation, unit quaternion, shape (4,).
        twist_frame: Body id of the frame in which the velocities are expressed; 0 is the world. Its own velocity is not
            added.
        linear: Linear velocity [m/s], shape (3,).
        angular: Angular velocity [rad/s], shape (3,).
    """

    body: int
    joint: int
    pose_frame: int
    pos: Array
    quat_wxyz: Array
    twist_frame: int
    linear: Array
    angular: Array


def validate(simulation: Simulation, states: Iterable[FreeJointState]) -> list[FreeJointTarget]:
    """Checks every entry and returns what to apply.

    Raises:
        RequestError: An entry is wrong; the sentence has its index, its name and the reason.
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
                f"free_joints[{index}] ({quoted(state.name)}): already given as free_joints[{first[target.body]}]"
            )
        first[target.body] = index
        targets.append(target)
    return targets


def apply(simulation: Simulation, targets: Iterable[FreeJointTarget]) -> None:
    """Writes poses and velocities; all frames are read before the first is written, so that the order does not matter.

    Derived quantities are stale afterwards: call `simulation.forward`.
    """
    # Whatever wrote positions before may not have said so.
    simulation.positions_changed()
    simulation.kinematics()
    model, data = simulation.model, simulation.data
    xpos, xquat = data.xpos.copy(), data.xquat.copy()
    for target in targets:
        quat_x = xquat[target.pose_frame]
        quat = compose(quat_x, target.quat_wxyz) if target.pose_frame else target.quat_wxyz
        qpos = int(model.jnt_qposadr[target.joint])
        dof = int(model.jnt_dofadr[target.joint])
        data.qpos[qpos : qpos + 3] = (
            xpos[target.pose_frame] + rotate(quat_x, target.pos) if target.pose_frame else target.pos
        )
        data.qpos[qpos + 3 : qpos + 7] = quat
        linear_w, angular_w = target.linear, target.angular
        if target.twist_frame:
            linear_w, angular_w = (rotate(xquat[target.twist_frame], v) for v in (linear_w, angular_w))
        data.qvel[dof : dof + 3] = linear_w
        data.qvel[dof + 3 : dof + 6] = rotate(inverse(quat), angular_w)


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
