"""Requests for wrenches, and an independent computation of what they do."""

import mujoco
import numpy as np
from conftest import BOX

from mjplug_schemas.builtin_interfaces import Duration
from mjplug_schemas.geometry_msgs import Point, Vector3, Wrench, WrenchStamped
from mjplug_schemas.mujoco_ros2_control_msgs import ApplyExternalWrench, ExternalWrenchArray
from mjplug_schemas.mujoco_ros2_control_msgs import ExternalWrench as ExternalWrenchMsg
from mjplug_schemas.std_msgs import Header


def xyz(cls, values):
    return cls(**dict(zip("xyz", map(float, values), strict=True)))


def push(body="box", force=(0, 0, 0), torque=(0, 0, 0), point=(0, 0, 0), duration=0.0, ramp=0.0):
    return ExternalWrenchMsg(
        wrench=WrenchStamped(
            header=Header(frame_id=body), wrench=Wrench(force=xyz(Vector3, force), torque=xyz(Vector3, torque))
        ),
        application_point=xyz(Point, point),
        duration=Duration.from_ns(round(duration * 1e9)),
        ramp_down_duration=Duration.from_ns(round(ramp * 1e9)),
    )


def request(*pushes):
    return ApplyExternalWrench.Request(wrenches=ExternalWrenchArray(external_wrenches=list(pushes)))


class Reference:
    """Replays wrenches with MuJoCo and numpy alone: by definition, force and point turn with the body at every step."""

    def __init__(self):
        self.model = mujoco.MjModel.from_xml_string(BOX)
        self.data = mujoco.MjData(self.model)
        self.time = 0.0

    def step(self, *wrenches):
        """Takes one step with wrenches given as (body, force, torque, point, scale)."""
        mujoco.mj_kinematics(self.model, self.data)
        self.data.xfrc_applied[:] = 0
        for body, force, torque, point, scale in wrenches:
            b = self.model.body(body).id
            rotation = self.data.xmat[b].reshape(3, 3)
            force_w = scale * rotation @ force
            arm = self.data.xpos[b] + rotation @ point - self.data.xipos[b]
            self.data.xfrc_applied[b, :3] += force_w
            self.data.xfrc_applied[b, 3:] += scale * rotation @ torque + np.cross(arm, force_w)
        mujoco.mj_step(self.model, self.data)
