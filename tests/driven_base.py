"""A floating base that BaseVelocity drives."""

import mujoco
import numpy as np

from mjplug.testing import World
from mjplug_plugins.base_velocity import BaseVelocity
from mjplug_schemas.geometry_msgs import Twist, Vector3

DT = 0.002

BALL = """
<mujoco>
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <body name="post" pos="5 0 0"><geom size=".1"/></body>
    <body name="other"><freejoint/><geom size=".1" pos="0 3 0"/></body>
    <body name="base"><freejoint/><geom size=".1" contype="0" conaffinity="0"/></body>
  </worldbody>
</mujoco>
"""

BASE = slice(6, 12)


def twist(vx=0.0, vy=0.0, yaw_rate=0.0, **others):
    linear, angular = {"x": vx, "y": vy}, {"z": yaw_rate}
    for name, value in others.items():
        (linear if name == "vz" else angular)[name[-1]] = value
    return Twist(linear=Vector3(**linear), angular=Vector3(**angular))


def world_of(xml=BALL, **parameters):
    world = World(mujoco.MjModel.from_xml_string(xml))
    world.plugin = world.add(BaseVelocity, "drive", **{"body": "base", **parameters})
    return world


def command(world, *values, **others):
    world.transport.send("/drive/cmd_vel", twist(*values, **others))


def velocity_in_body(world, qpos, qvel):
    """Linear and angular velocity of a state in the axes of the body, by MuJoCo itself."""
    data = mujoco.MjData(world.model)
    data.qpos[:], data.qvel[:] = qpos, qvel
    mujoco.mj_forward(world.model, data)
    velocity = np.empty(6)
    mujoco.mj_objectVelocity(world.model, data, mujoco.mjtObj.mjOBJ_XBODY, world.model.body("base").id, velocity, 1)
    return velocity[3:], velocity[:3]
