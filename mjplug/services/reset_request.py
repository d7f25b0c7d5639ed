"""Validates requests to reset the world. The whole request is checked before anything is applied."""

import math

import mujoco

from mjplug.errors import RequestError, quoted
from mjplug.physics.reset import JointOverride, Reset
from mjplug.physics.simulation import Simulation
from mjplug.services.free_joint_request import validate as validate_free_joints
from mjplug_schemas.mujoco_ros2_control_msgs import SimulationState
from mjplug_schemas.sensor_msgs import JointState

_SCALAR = {int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)}


def validate(simulation: Simulation, keyframe: str, overrides: SimulationState) -> Reset:
    """Checks a whole request and returns the reset to apply.

    Args:
        simulation: The simulation whose model defines the names.
        keyframe: Name or index of a keyframe; empty means the initial state.
        overrides: Joint and free body states to set after the keyframe or initial state.

    Raises:
        RequestError: A value is invalid; the message contains it and the allowed ones. The state is unchanged.
    """
    return Reset(
        keyframe=simulation.keyframe_id(keyframe) if keyframe else None,
        joints=_joint_overrides(simulation, overrides.joint_states),
        free_joints=validate_free_joints(simulation, overrides.free_joints),
    )


def _joint_overrides(simulation: Simulation, states: JointState) -> list[JointOverride]:
    count = len(states.name)
    if states.effort:
        raise RequestError("joint_states.effort cannot be set by a reset; leave it empty")
    for part, values in (("position", states.position), ("velocity", states.velocity)):
        if values and len(values) != count:
            raise RequestError(
                f"joint_states.{part} has {len(values)} entries for {count} names; give one for each name, or none"
            )
    if count and not states.position and not states.velocity:
        raise RequestError("joint_states has names, but neither position nor velocity; give at least one of them")
    overrides: list[JointOverride] = []
    first: dict[int, int] = {}
    for index, name in enumerate(states.name):
        position = states.position[index] if states.position else None
        velocity = states.velocity[index] if states.velocity else None
        try:
            override = _joint_override(simulation, name, position, velocity)
        except RequestError as error:
            raise RequestError(f"joint_states[{index}] ({quoted(name)}): {error}") from None
        if override.joint in first:
            raise RequestError(
                f"joint_states[{index}] ({quoted(name)}): duplicate of joint_states[{first[override.joint]}]; "
                "list each joint once"
            )
        first[override.joint] = index
        overrides.append(override)
    return overrides


def _joint_override(simulation: Simulation, name: str, position: float | None, velocity: float | None) -> JointOverride:
    model = simulation.model
    joint = simulation.joint_id(name)
    kind = int(model.jnt_type[joint])
    if kind not in _SCALAR:
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            raise RequestError("this is a free joint; set its body's state in state_overrides.free_joints")
        raise RequestError("this is a ball joint; only hinge and slide joints can be overridden")
    for part, value in (("position", position), ("velocity", velocity)):
        if value is not None and not math.isfinite(value):
            raise RequestError(f"{part} is {value:g}; it must be finite")
        if value is not None and abs(value) >= mujoco.mjMAXVAL:
            raise RequestError(f"{part} is {value:g}; its absolute value must be below {mujoco.mjMAXVAL:g}")
    if position is not None and model.jnt_limited[joint]:
        low, high = model.jnt_range[joint]
        if not low <= position <= high:
            raise RequestError(f"position {position:g} is outside the joint's range [{low:g}, {high:g}]")
    return JointOverride(joint, position, velocity)
