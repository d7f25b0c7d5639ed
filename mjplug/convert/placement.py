"""Where a robot is and how large it is, for the choice of its scene."""

import mujoco
import numpy as np

from mjplug.convert.measure import lowest_points
from mjplug.convert.robot import Robot
from mjplug.convert.scene import Placement


def placement(robot: Robot, model: mujoco.MjModel, data: mujoco.MjData, free: bool) -> Placement:
    """Returns the place of a robot in its present pose.

    Args:
        robot: The robot.
        model: Its model without a scene.
        data: A state whose poses are computed.
        free: Whether the base is free.
    """
    fixed = set(robot.rigid_group(robot.root))
    moving = {name: value for name, value in lowest_points(robot, model, data).items() if name not in fixed}
    corners = _corners(model, data)
    low, high = corners.min(axis=0), corners.max(axis=0)
    center = (low + high) / 2.0
    return Placement(
        free,
        min(moving.values(), default=0.0),
        float(high[0]),
        (float(center[0]), float(center[1]), float(center[2])),
        0.9 * float(np.linalg.norm(high - low)),
    )


def _corners(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Returns points that enclose all geoms, shape (n, 3) [m]."""
    reach = model.geom_rbound[:, None]
    if not len(reach):
        return np.zeros((1, 3))
    return np.concatenate([data.geom_xpos - reach, data.geom_xpos + reach])
