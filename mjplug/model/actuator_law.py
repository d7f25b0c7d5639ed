"""The quantity that an actuator drives, and the control for a target value of it."""

from dataclasses import dataclass
from enum import StrEnum

import mujoco

_FIXED = int(mujoco.mjtGain.mjGAIN_FIXED)
_NO_BIAS, _AFFINE = int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE)
_INTEGRATOR = int(mujoco.mjtDyn.mjDYN_INTEGRATOR)
_DIRECT = {int(mujoco.mjtDyn.mjDYN_NONE), int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT)}

_MAX_GAIN_DIFFERENCE = 1e-6
"""Maximum relative difference between the gain and the damping of a velocity servo."""


class Drives(StrEnum):
    """The quantity of the transmission that an actuator drives."""

    POSITION = "position"
    VELOCITY = "velocity"
    EFFORT = "effort"
    OTHER = "other"


@dataclass(frozen=True, slots=True)
class ActuatorLaw:
    """The control of an actuator for a target value: control = ratio · target + offset.

    Attributes:
        drives: The quantity of the target: the length of the transmission [rad, m], its velocity [rad/s, m/s], or the
            force along it [N·m, N]. For muscles, adhesion, plugins and others it is the control itself.
        ratio: Control per unit of the target.
        offset: Control for a target of zero.
    """

    drives: Drives
    ratio: float = 1.0
    offset: float = 0.0

    def control(self, target: float) -> float:
        """Returns the control for a target; without load, a servo reaches it."""
        return self.ratio * target + self.offset


def actuator_law(model: mujoco.MjModel, actuator: int) -> ActuatorLaw:
    """Returns the law of an actuator.

    MuJoCo's force is gain · control + b0 + b1 · length + b2 · velocity, where an activation may replace the control. An
    actuator whose bias depends on the length is a position servo: `position` has b1 = -gain; a gripper with controls
    from 0 to 255 has other units. An actuator whose bias depends on the velocity alone is a velocity servo if
    b2 = -gain; otherwise it is a motor with damping.

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
        # The activation is the target length, and the control is its rate of change.
        return ActuatorLaw(Drives.VELOCITY, -stiffness / gain)
    if dynamics not in _DIRECT:
        return ActuatorLaw(Drives.OTHER)
    if stiffness:
        return ActuatorLaw(Drives.POSITION, -stiffness / gain, -constant / gain)
    if damping and abs(damping + gain) <= _MAX_GAIN_DIFFERENCE * abs(gain):
        return ActuatorLaw(Drives.VELOCITY, -damping / gain, -constant / gain)
    return ActuatorLaw(Drives.EFFORT, 1.0 / gain, -constant / gain)
