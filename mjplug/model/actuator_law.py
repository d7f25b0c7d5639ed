"""What a control means: which quantity an actuator drives, and the control that asks for a value of it."""

from dataclasses import dataclass
from enum import StrEnum

import mujoco

_FIXED = int(mujoco.mjtGain.mjGAIN_FIXED)
_NO_BIAS, _AFFINE = int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE)
_INTEGRATOR = int(mujoco.mjtDyn.mjDYN_INTEGRATOR)
_DIRECT = {int(mujoco.mjtDyn.mjDYN_NONE), int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT)}

_ALIKE = 1e-6
"""Relative difference up to which the gain of a velocity servo and its damping count as the same number."""


class Drives(StrEnum):
    """What an actuator drives its transmission to."""

    POSITION = "position"
    VELOCITY = "velocity"
    EFFORT = "effort"
    OTHER = "other"


@dataclass(frozen=True, slots=True)
class ActuatorLaw:
    """How the control of an actuator follows from what is wanted: control = ratio · wanted + offset.

    Attributes:
        drives: What is wanted: a length of the transmission [rad, m], its velocity, or the force along it [N·m, N]. For
            muscles, adhesion, plugins and whatever else has no such quantity it is the control itself.
        ratio: Control per unit of it.
        offset: Control for zero of it.
    """

    drives: Drives
    ratio: float = 1.0
    offset: float = 0.0

    def control(self, wanted: float) -> float:
        """Returns the control that asks for a value; without load, a servo then comes to rest there."""
        return self.ratio * wanted + self.offset


def actuator_law(model: mujoco.MjModel, actuator: int) -> ActuatorLaw:
    """Returns what an actuator drives.

    MuJoCo's force is gain · control + b0 + b1 · length + b2 · velocity, in which an activation may stand for the
    control. What has a bias that the control can balance is a servo: `position` has b1 = -gain; a gripper whose control
    counts from 0 to 255 has it in other units. A bias of damping alone makes a velocity servo only where it is as large
    as the gain; otherwise it is a motor with friction.

    Args:
        model: The compiled model.
        actuator: The actuator's id.
    """
    gain = float(model.actuator_gainprm[actuator, 0])
    bias, dynamics = int(model.actuator_biastype[actuator]), int(model.actuator_dyntype[actuator])
    linear = model.actuator_gaintype[actuator] == _FIXED and bias in (_NO_BIAS, _AFFINE) and gain != 0.0
    if not linear or model.actuator_plugin[actuator] >= 0:
        return ActuatorLaw(Drives.OTHER)
    constant, stiffness, damping = model.actuator_biasprm[actuator, :3].tolist() if bias == _AFFINE else (0.0,) * 3
    if dynamics == _INTEGRATOR and stiffness:
        # The activation is the length to hold, and the control is how fast that moves.
        return ActuatorLaw(Drives.VELOCITY, -stiffness / gain)
    if dynamics not in _DIRECT:
        return ActuatorLaw(Drives.OTHER)
    if stiffness:
        return ActuatorLaw(Drives.POSITION, -stiffness / gain, -constant / gain)
    if damping and abs(damping + gain) <= _ALIKE * abs(gain):
        return ActuatorLaw(Drives.VELOCITY, -damping / gain, -constant / gain)
    return ActuatorLaw(Drives.EFFORT, 1.0 / gain, -constant / gain)
