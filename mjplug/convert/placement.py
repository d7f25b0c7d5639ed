"""Where a robot is and how large it is, for the choice of its scene."""

import mujoco
import numpy as np

from mjplug.convert.measure import lowest_points
from mjplug.convert.robot import Robot
from mjplug.convert.scene import Placement, corners_of


def placement(robot: Robot, model: mujoco.MjModel, data: mujoco.MjData, free: bool) -> Placement:
    """Returns the place of a robot in its present pose.

    If the base of a fixed robot has no geometry, nothing of it stands on the floor. Then the lowest point is one that
    the robot cannot reach, so that the floor does not stop its links.

    Args:
        robot: The robot.
        model: Its model without a scene.
        data: A state whose poses are computed.
        free: Whether the base is free.
    """
    fixed = set(robot.rigid_group(robot.root))
    lowest = lowest_points(robot, model, data)
    moving = {name: value for name, value in lowest.items() if name not in fixed}
    hangs = not free and bool(moving) and len(moving) == len(lowest)
    corners = corners_of(model, data, range(model.ngeom))
    low, high = corners.min(axis=0), corners.max(axis=0)
    center = (low + high) / 2.0
    return Placement(
        free,
        -_reach(model) if hangs else min(moving.values(), default=0.0),
        float(high[0]),
        (float(center[0]), float(center[1]), float(center[2])),
        0.9 * float(np.linalg.norm(high - low)),
    )


def _reach(model: mujoco.MjModel) -> float:
    """Returns a distance from the origin that no geom exceeds in any pose [m]."""
    reach = np.zeros(model.nbody)
    for body in range(1, model.nbody):
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        slides = [
            float(np.abs(model.jnt_range[joint]).max())
            for joint in range(first, first + count)
            if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE
        ]
        reach[body] = reach[model.body_parentid[body]] + np.linalg.norm(model.body_pos[body]) + sum(slides)
    geoms = reach[model.geom_bodyid] + np.linalg.norm(model.geom_pos, axis=1) + model.geom_rbound
    return float(geoms.max(initial=0.0))
