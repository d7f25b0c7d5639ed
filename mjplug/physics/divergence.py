"""Detects a diverged simulation and finds the joint where it diverged."""

from dataclasses import dataclass

import mujoco

_WARNINGS = (
    (mujoco.mjtWarning.mjWARN_BADQPOS, "position"),
    (mujoco.mjtWarning.mjWARN_BADQVEL, "velocity"),
    (mujoco.mjtWarning.mjWARN_BADQACC, "acceleration"),
)
"""MuJoCo's own checks, in the order in which a step performs them."""


@dataclass(frozen=True, slots=True)
class Divergence:
    """A value that MuJoCo found to be NaN, infinite or above 1e10 in a step.

    Attributes:
        quantity: `position`, `velocity` or `acceleration`.
        joint: Name of the joint; `#<id>` if it is unnamed.
        body: Name of the joint's body; `#<id>` if it is unnamed.
        axis: Index of the joint's coordinate, from 0.
    """

    quantity: str
    joint: str
    body: str
    axis: int

    @property
    def in_state(self) -> bool:
        """Whether the state was already invalid when the step began, so that only a reset helps."""
        return self.quantity != "acceleration"

    def __str__(self) -> str:
        place = f"joint {self.joint} (coordinate {self.axis}, body {self.body})"
        return f"{self.quantity} of {place} is NaN, infinite or above 1e10"


def find(model: mujoco.MjModel, data: mujoco.MjData) -> Divergence | None:
    """Returns the divergence that MuJoCo's warning counters report; None if there is none."""
    for kind, quantity in _WARNINGS:
        warning = data.warning[int(kind)]
        if warning.number:
            return _locate(model, quantity, int(warning.lastinfo))
    return None


def clear(data: mujoco.MjData) -> None:
    """Sets the warning counters that `find` reads to zero."""
    for kind, _ in _WARNINGS:
        data.warning.number[int(kind)] = 0


def _locate(model: mujoco.MjModel, quantity: str, index: int) -> Divergence:
    starts = model.jnt_qposadr if quantity == "position" else model.jnt_dofadr
    joint = max((j for j in range(model.njnt) if starts[j] <= index), default=0)
    body = int(model.jnt_bodyid[joint])
    joint_name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, joint) or f"#{joint}"
    body_name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body) or f"#{body}"
    return Divergence(quantity, joint_name, body_name, index - int(starts[joint]))
