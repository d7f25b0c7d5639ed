"""Checks a converted model against the URDF: poses of links and masses."""

import mujoco
import numpy as np

from mjplug.convert.kinematics import link_poses
from mjplug.convert.measure import random_poses, set_positions
from mjplug.convert.robot import Robot
from mjplug.convert.write_bodies import WORLD
from mjplug.errors import ModelError

_POSES, _TOLERANCE = 5, 1e-9


def check_model(robot: Robot, model: mujoco.MjModel, fused: bool) -> None:
    """Compares the model with the URDF.

    Args:
        robot: The robot.
        model: The converted model.
        fused: Whether links behind fixed joints were merged, so that they cannot be compared.

    Raises:
        ModelError: The model is wrong, which is an error of the converter.
    """
    if fused:
        return
    data = mujoco.MjData(model)
    bodies = {name: model.body(name).id for name in robot.links if name != WORLD}
    coupled = any(joint.type in ("floating", "planar", "ball") for joint in robot.joints.values())
    if not coupled:
        for pose in random_poses(robot, _POSES):
            set_positions(robot, model, data, pose)
            mujoco.mj_kinematics(model, data)
            root = np.eye(4)
            if robot.root in bodies:
                body = bodies[robot.root]
                root[:3, :3], root[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
            wanted = link_poses(robot, pose, root)
            for name, body in bodies.items():
                error = max(
                    float(np.abs(data.xpos[body] - wanted[name][:3, 3]).max()),
                    float(np.abs(data.xmat[body].reshape(3, 3) - wanted[name][:3, :3]).max()),
                )
                if error > _TOLERANCE * max(1.0, float(np.abs(wanted[name]).max())):
                    raise ModelError(
                        f"link {name!r} of the converted model is {error:g} m away from its place in the URDF"
                    )
    for name, body in bodies.items():
        inertial = robot.links[name].inertial
        if inertial is not None and abs(model.body_mass[body] - inertial.mass) > 1e-9 * inertial.mass:
            raise ModelError(
                f"link {name!r} of the converted model has {model.body_mass[body]:g} kg instead of {inertial.mass:g} kg"
            )
