"""Forward kinematics of a robot, from its description alone."""

from collections.abc import Mapping

import numpy as np

from mjplug.convert.robot import MOVING_HINGES, Joint, Robot
from mjplug.convert.rotations import Array, about_axis


def link_poses(robot: Robot, positions: Mapping[str, float], root: Array | None = None) -> dict[str, Array]:
    """Returns the pose of each link, as homogeneous matrices (4, 4).

    Args:
        robot: The robot.
        positions: Positions of joints [rad, m]; a joint that is not in it is at zero. Mimic joints are computed.
        root: Pose of the root link; default: the origin.
    """
    poses = {robot.root: np.eye(4) if root is None else root}
    for joint in robot.walk():
        poses[joint.child] = (
            poses[joint.parent] @ joint.pose @ joint_motion(joint, position_of(robot, joint, positions))
        )
    return poses


def position_of(robot: Robot, joint: Joint, positions: Mapping[str, float]) -> float:
    """Returns the position of a joint; that of a mimic joint follows its leader."""
    if joint.mimic is None:
        return float(positions.get(joint.name, 0.0))
    leader = robot.joints[joint.mimic.joint]
    return joint.mimic.multiplier * position_of(robot, leader, positions) + joint.mimic.offset


def joint_motion(joint: Joint, position: float) -> Array:
    """Returns the pose of the moved child in its pose at zero."""
    motion = np.eye(4)
    if joint.type in MOVING_HINGES:
        motion[:3, :3] = about_axis(joint.axis, position)
    elif joint.type == "prismatic":
        motion[:3, 3] = joint.axis * position
    return motion
