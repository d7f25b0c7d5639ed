"""The task `mjplug/ArmReach-v0`: move the hand of the bundled arm to a random point."""

from typing import Any

import mujoco
import numpy as np

from mjplug.client.driver import StepResult
from mjplug.gym.env import Array, MjplugEnv, Start, unit_box

_JOINTS = ("joint1", "joint2")
_HAND = "ee_link"
_RANGE = 2.8
"""Largest target angle of a hinge [rad]."""

_RADII, _ANGLES = (0.8, 2.0), (-1.5, 1.5)
"""Limits of the distance of the target from the shoulder [m], and of its angle from the vertical [rad]."""


class ArmReach(MjplugEnv):
    """Move the hand to a point in the plane of the arm.

    The action contains the target angles of both hinges; 1 is 2.8 rad. The gripper stays open. The observation
    contains angles and velocities of the hinges [rad, rad/s], the position of the hand and that of the target [m]. The
    reward is minus the distance of the hand from the target [m]. An action takes 20 ms.

    Args:
        render_mode: `rgb_array` or None.
        **options: Options of `mjplug.open_server`.
    """

    def __init__(self, render_mode: str | None = None, **options: Any) -> None:
        self._target = np.zeros(3)
        self._site = -1
        if render_mode:
            camera = {"type": "camera", "sync": True, "width": 320, "height": 240}
            options = {**options, "plugins": {**options.get("plugins", {}), "camera": camera}}
        super().__init__(
            "bundled:arm",
            observe=("qpos", "qvel", "site_xpos"),
            steps=10,
            render_mode=render_mode,
            action_space=unit_box(2),
            camera="/camera/camera/color",
            **options,
        )

    def draw_start(self, random: np.random.Generator) -> Start:
        """Draws the target, and the angles of the hinges."""
        radius, angle = random.uniform(*_RADII), random.uniform(*_ANGLES)
        self._target = radius * np.array([np.sin(angle), 0.0, np.cos(angle)])
        angles = random.uniform(-0.3, 0.3, 2).tolist()
        return {"state_overrides": {"joint_states": {"name": list(_JOINTS), "position": angles}}}

    def observation_of(self, result: StepResult) -> Array:
        """Returns the observation."""
        if self._site < 0:
            self._site = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_SITE, _HAND)
        hand = result["site_xpos"][self._site]
        return np.concatenate([result["qpos"][:2], result["qvel"][:2], hand, self._target])

    def controls_of(self, action: Array) -> Array:
        """Returns the target angles of the hinges [rad], and 0 for the gripper."""
        return np.array([_RANGE * action[0], _RANGE * action[1], 0.0])

    def reward_of(self, observation: Array, action: Array) -> float:
        """Returns minus the distance of the hand from the target [m]."""
        return -float(np.linalg.norm(observation[4:7] - observation[7:10]))
