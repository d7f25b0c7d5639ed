"""Sets pose and twist of free bodies, given in the world frame or in the frame of another body.

MuJoCo stores the linear velocity of a free joint in the world frame and its angular velocity in the body's own frame
(https://mujoco.readthedocs.io/en/stable/overview.html#floating-objects). Messages give both in one frame.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from mjplug.physics.frames import Array, compose, inverse, rotate
from mjplug.physics.simulation import Simulation


@dataclass(frozen=True, slots=True)
class FreeJointTarget:
    """A validated target state of one free body.

    Attributes:
        body: The body's id.
        joint: Id of its free joint.
        pose_frame: Body id of the frame of `pos` and `quat_wxyz`; 0 is the world.
        pos: Position in `pose_frame` [m], shape (3,).
        quat_wxyz: Orientation in `pose_frame`, unit quaternion, shape (4,).
        twist_frame: Body id of the frame in which the velocities are expressed; 0 is the world. The velocity of that
            body is not added.
        linear: Linear velocity in the axes of `twist_frame` [m/s], shape (3,).
        angular: Angular velocity in the axes of `twist_frame` [rad/s], shape (3,).
    """

    body: int
    joint: int
    pose_frame: int
    pos: Array
    quat_wxyz: Array
    twist_frame: int
    linear: Array
    angular: Array


def apply(simulation: Simulation, targets: Iterable[FreeJointTarget]) -> None:
    """Writes poses and velocities. All frames are read before the first write, so the order does not matter.

    Derived quantities are out of date afterwards; call `simulation.forward`.
    """
    # Positions may have been written without a call of `mark_poses_outdated`.
    simulation.mark_poses_outdated()
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
