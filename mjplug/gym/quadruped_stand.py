"""The task `mjplug/QuadrupedStand-v0`: keep the bundled quadruped standing after a random start."""

from typing import Any

import numpy as np

from mjplug.client.driver import StepResult
from mjplug.gym.env import Array, MjplugEnv, Start, unit_box

_LEGS, _PARTS = ("FL", "FR", "RL", "RR"), ("hip", "thigh", "calf")
_STANDING = np.array([0.0, 0.8, -1.6] * 4)
"""Target angles of the joints of a standing robot [rad]."""

_RANGE = 0.5
"""Largest distance of a target angle from the standing pose [rad]."""

_HEIGHT, _FALLEN = 0.307, 0.15
"""Height of the base of a standing robot, and the height below which it has fallen [m]."""


class QuadrupedStand(MjplugEnv):
    """Keep the base level and at its height.

    The action contains the target angles of the twelve joints relative to the standing pose; 1 is 0.5 rad. The
    observation contains height and orientation of the base (w, x, y, z), the angles, and all velocities. The reward is
    1 for the standing pose and decreases with height error, tilt and the square of the action. The episode ends when
    the robot has fallen. An action takes 20 ms.

    Args:
        render_mode: `rgb_array` or None.
        **options: Options of `mjplug.open_server`.
    """

    def __init__(self, render_mode: str | None = None, **options: Any) -> None:
        if render_mode:
            camera = {"type": "camera", "sync": True, "width": 320, "height": 240}
            options = {**options, "plugins": {**options.get("plugins", {}), "camera": camera}}
        super().__init__(
            "bundled:quadruped",
            steps=10,
            render_mode=render_mode,
            action_space=unit_box(12),
            camera="/camera/overview/color",
            **options,
        )

    def draw_start(self, random: np.random.Generator) -> Start:
        """Draws the angles of the joints around the standing pose."""
        names = [f"{leg}_{part}_joint" for leg in _LEGS for part in _PARTS]
        angles = (_STANDING + random.uniform(-0.1, 0.1, 12)).tolist()
        return {"keyframe": "home", "state_overrides": {"joint_states": {"name": names, "position": angles}}}

    def observation_of(self, result: StepResult) -> Array:
        """Returns the observation."""
        # Without the horizontal position, which does not matter.
        return np.concatenate([result["qpos"][2:], result["qvel"]])

    def controls_of(self, action: Array) -> Array:
        """Returns the target angles of the joints [rad]."""
        return _STANDING + _RANGE * np.asarray(action)

    def reward_of(self, observation: Array, action: Array) -> float:
        """Returns the reward."""
        _, x, y, _ = observation[1:5]
        # The z component of the base's own z axis.
        upright = 1.0 - 2.0 * (x * x + y * y)
        effort = float(np.mean(np.square(action)))
        return float(upright - 5.0 * abs(observation[0] - _HEIGHT) - 0.1 * effort)

    def is_terminated(self, observation: Array) -> bool:
        """Returns whether the robot has fallen."""
        return bool(observation[0] < _FALLEN)
