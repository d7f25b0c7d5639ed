"""Finds the actuators that move each joint, and the transmission length per unit of joint motion."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import mujoco

from mjplug.plugin import Host, PluginError, UnknownName
from mjplug.plugin.bundled import ActuatorLaw, Drives, actuator_law
from mjplug_plugins.joints.outputs import MAX_VALUE
from mjplug_plugins.joints.scalar_joint import ScalarJoint

_JOINT = {int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)}
_TENDON = int(mujoco.mjtTrn.mjTRN_TENDON)
_WRAPPED_JOINT = int(mujoco.mjtWrap.mjWRAP_JOINT)


@dataclass(frozen=True, slots=True)
class Actuator:
    """An actuator that moves a joint.

    Attributes:
        actuator: Its id.
        name: Its name; empty if it has none.
        law: Relation between its control and the driven quantity.
        transmission: Change of the transmission length per unit of joint motion [per rad or m].
    """

    actuator: int
    name: str
    law: ActuatorLaw
    transmission: float

    def limits(self, model: mujoco.MjModel, clamp: bool) -> tuple[float, float]:
        """Returns the lowest and the highest effective control; without `clamp`, those that MuJoCo accepts."""
        low, high = -MAX_VALUE, MAX_VALUE
        if clamp and model.actuator_ctrllimited[self.actuator]:
            low, high = (
                min(max(end, -MAX_VALUE), MAX_VALUE) for end in model.actuator_ctrlrange[self.actuator].tolist()
            )
        if clamp and model.actuator_forcelimited[self.actuator] and self.law.drives is Drives.EFFORT:
            ends = sorted(self.law.control(force) for force in model.actuator_forcerange[self.actuator].tolist())
            low, high = max(low, min(ends[0], high)), min(high, max(ends[1], low))
        return low, high

    def scale(self, drives: Drives) -> tuple[float, float]:
        """Returns the control per unit of the joint's position, velocity or effort, and the control for zero."""
        if drives is Drives.EFFORT:
            return (
                (self.law.ratio / self.transmission, self.law.offset) if self.transmission else (0.0, self.law.offset)
            )
        return self.law.ratio * self.transmission, self.law.offset


def actuators_of(
    host: Host, joints: Mapping[str, ScalarJoint], configured: Mapping[str, Sequence[str]]
) -> dict[str, list[Actuator]]:
    """Returns the actuators of each actuated joint, by joint name, in the order of the model.

    An actuator at a joint drives that joint. Any other actuator drives the joint with the same name, or else the first
    joint of its fixed tendon. `configured` overrides these rules.

    Args:
        host: Provides the model.
        joints: The hinges and slides by name.
        configured: Names of the actuators of joints, by joint name.

    Raises:
        UnknownName: The model has no such joint or actuator.
        PluginError: An actuator is configured for two joints.
    """
    model = host.model
    names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, i) or "" for i in range(model.nu)]
    owners: dict[int, str] = {}
    for joint, actuators in configured.items():
        if joint not in joints:
            raise UnknownName("joint", joint, joints)
        for name in actuators:
            if not name or name not in names:
                raise UnknownName("actuator", name, names)
            if (owner := owners.setdefault(names.index(name), joint)) != joint:
                raise PluginError(f"actuator {name!r} is configured for two joints, {owner!r} and {joint!r}")
    by_id = {joint.joint: joint for joint in joints.values()}
    by_joint: dict[str, list[Actuator]] = {}
    for actuator, name in enumerate(names):
        joint = owners.get(actuator) or _driven(model, actuator, name, joints, by_id)
        if joint:
            transmission = _transmission(model, actuator, joints[joint])
            by_joint.setdefault(joint, []).append(Actuator(actuator, name, actuator_law(model, actuator), transmission))
    return {joint: by_joint[joint] for joint in joints if joint in by_joint}


def _driven(
    model: mujoco.MjModel,
    actuator: int,
    name: str,
    joints: Mapping[str, ScalarJoint],
    by_id: Mapping[int, ScalarJoint],
) -> str:
    """Returns the name of the joint that an actuator drives according to the model; empty if unknown."""
    kind, target = int(model.actuator_trntype[actuator]), int(model.actuator_trnid[actuator, 0])
    if kind in _JOINT:
        return by_id[target].name if target in by_id else ""
    if name in joints:
        return name
    if kind == _TENDON:
        return next((by_id[joint].name for joint, _ in _fixed_tendon(model, target) if joint in by_id), "")
    return ""


def _transmission(model: mujoco.MjModel, actuator: int, joint: ScalarJoint) -> float:
    """Returns the change of an actuator's transmission length per unit of joint motion [per rad or m].

    The joints of a fixed tendon are assumed to move together, like the fingers of a gripper. For other transmissions
    than joints and fixed tendons, commands are in units of the transmission length.
    """
    gear, target = float(model.actuator_gear[actuator, 0]), int(model.actuator_trnid[actuator, 0])
    if int(model.actuator_trntype[actuator]) != _TENDON:
        return gear
    coefficients = dict(_fixed_tendon(model, target))
    if not coefficients.get(joint.joint):
        return gear
    total = sum(map(abs, coefficients.values()))
    return gear * (total if coefficients[joint.joint] > 0 else -total)


def _fixed_tendon(model: mujoco.MjModel, tendon: int) -> Iterable[tuple[int, float]]:
    """Returns the joint ids of a fixed tendon with their coefficients; empty for a spatial tendon."""
    first, count = int(model.tendon_adr[tendon]), int(model.tendon_num[tendon])
    return [
        (int(model.wrap_objid[wrap]), float(model.wrap_prm[wrap]))
        for wrap in range(first, first + count)
        if int(model.wrap_type[wrap]) == _WRAPPED_JOINT
    ]
