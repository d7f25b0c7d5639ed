"""Which actuators move a joint, and how far they do for one unit of it."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import mujoco

from mjplug.plugin import Host, PluginError, UnknownName
from mjplug.plugin.bundled import ActuatorLaw, Drives, actuator_law
from mjplug_plugins.joints.route import LARGEST
from mjplug_plugins.joints.scalar_joint import ScalarJoint

_JOINT = {int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)}
_TENDON = int(mujoco.mjtTrn.mjTRN_TENDON)
_WRAPPED_JOINT = int(mujoco.mjtWrap.mjWRAP_JOINT)


@dataclass(frozen=True, slots=True)
class Actuator:
    """An actuator as one joint sees it.

    Attributes:
        actuator: Its id.
        name: Its name; empty if it has none.
        law: What its control means.
        reach: How much its transmission's length changes with the joint [per rad or m].
    """

    actuator: int
    name: str
    law: ActuatorLaw
    reach: float

    def limits(self, model: mujoco.MjModel, clamp: bool) -> tuple[float, float]:
        """Returns the lowest and the highest control that makes a difference; without `clamp`, that MuJoCo bears."""
        low, high = -LARGEST, LARGEST
        if clamp and model.actuator_ctrllimited[self.actuator]:
            low, high = (min(max(end, -LARGEST), LARGEST) for end in model.actuator_ctrlrange[self.actuator].tolist())
        if clamp and model.actuator_forcelimited[self.actuator] and self.law.drives is Drives.EFFORT:
            ends = sorted(self.law.control(force) for force in model.actuator_forcerange[self.actuator].tolist())
            low, high = max(low, min(ends[0], high)), min(high, max(ends[1], low))
        return low, high

    def scale(self, drives: Drives) -> tuple[float, float]:
        """Returns the control per unit of the joint's position, velocity or effort, and that for zero of it."""
        if drives is Drives.EFFORT:
            return (self.law.ratio / self.reach, self.law.offset) if self.reach else (0.0, self.law.offset)
        return self.law.ratio * self.reach, self.law.offset


def actuators_of(
    host: Host, joints: Mapping[str, ScalarJoint], configured: Mapping[str, Sequence[str]]
) -> dict[str, list[Actuator]]:
    """Returns the actuators of each joint that has any, by name of the joint, in the order of the model.

    An actuator at a joint drives that joint. Any other drives the joint that has its name; without one, the first joint
    of its fixed tendon. `configured` comes before all that.

    Args:
        host: Whose model it is.
        joints: The hinges and slides by name.
        configured: Names of actuators for joints.

    Raises:
        UnknownName: A configured joint or actuator is not there.
        PluginError: An actuator is configured for two joints.
    """
    model = host.model
    names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, i) or "" for i in range(model.nu)]
    owners: dict[int, str] = {}
    for joint, wanted in configured.items():
        if joint not in joints:
            raise UnknownName("joint", joint, joints)
        for name in wanted:
            if not name or name not in names:
                raise UnknownName("actuator", name, names)
            if (owner := owners.setdefault(names.index(name), joint)) != joint:
                raise PluginError(f"actuator {name!r} is given to two joints, {owner!r} and {joint!r}")
    by_id = {joint.joint: joint for joint in joints.values()}
    found: dict[str, list[Actuator]] = {}
    for actuator, name in enumerate(names):
        joint = owners.get(actuator) or _driven(model, actuator, name, joints, by_id)
        if joint:
            reach = _reach(model, actuator, joints[joint])
            found.setdefault(joint, []).append(Actuator(actuator, name, actuator_law(model, actuator), reach))
    return {joint: found[joint] for joint in joints if joint in found}


def _driven(
    model: mujoco.MjModel,
    actuator: int,
    name: str,
    joints: Mapping[str, ScalarJoint],
    by_id: Mapping[int, ScalarJoint],
) -> str:
    """Returns the joint that an actuator drives, by what the model says; empty if it says nothing."""
    transmission, target = int(model.actuator_trntype[actuator]), int(model.actuator_trnid[actuator, 0])
    if transmission in _JOINT:
        return by_id[target].name if target in by_id else ""
    if name in joints:
        return name
    if transmission == _TENDON:
        return next((by_id[joint].name for joint, _ in _fixed_tendon(model, target) if joint in by_id), "")
    return ""


def _reach(model: mujoco.MjModel, actuator: int, joint: ScalarJoint) -> float:
    """Returns how the length of an actuator's transmission changes with a joint.

    The joints of a fixed tendon are taken to move alike, as the fingers of a gripper do. What is no joint and no fixed
    tendon is commanded in its own length.
    """
    gear, target = float(model.actuator_gear[actuator, 0]), int(model.actuator_trnid[actuator, 0])
    if int(model.actuator_trntype[actuator]) != _TENDON:
        return gear
    coefficients = dict(_fixed_tendon(model, target))
    if not coefficients.get(joint.joint):
        return gear
    whole = sum(map(abs, coefficients.values()))
    return gear * (whole if coefficients[joint.joint] > 0 else -whole)


def _fixed_tendon(model: mujoco.MjModel, tendon: int) -> Iterable[tuple[int, float]]:
    """Returns the joints of a fixed tendon, with their coefficients; none of a spatial one."""
    first, count = int(model.tendon_adr[tendon]), int(model.tendon_num[tendon])
    return [
        (int(model.wrap_objid[wrap]), float(model.wrap_prm[wrap]))
        for wrap in range(first, first + count)
        if int(model.wrap_type[wrap]) == _WRAPPED_JOINT
    ]
