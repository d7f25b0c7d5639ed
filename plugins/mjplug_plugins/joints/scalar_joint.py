"""Hinges and slides: the joints that JointState messages can speak of."""

from collections.abc import Iterable
from dataclasses import dataclass

import mujoco

from mjplug.plugin import PluginError, UnknownName

_SCALAR = {int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)}


@dataclass(frozen=True, slots=True)
class ScalarJoint:
    """A hinge or a slide.

    Attributes:
        name: Its name.
        joint: Its id.
        qpos: Its place in `qpos` [rad or m].
        dof: Its place in `qvel` [rad/s or m/s] and among the forces [N·m or N].
    """

    name: str
    joint: int
    qpos: int
    dof: int


def scalar_joints(model: mujoco.MjModel) -> dict[str, ScalarJoint]:
    """Returns the hinges and slides that have a name, by name, in the order of the model."""
    found = {}
    for joint in range(model.njnt):
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, joint)
        if name and int(model.jnt_type[joint]) in _SCALAR:
            found[name] = ScalarJoint(name, joint, int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint]))
    return found


def chosen(joints: dict[str, ScalarJoint], names: Iterable[str], model: mujoco.MjModel) -> list[ScalarJoint]:
    """Returns the joints of some names, in their order.

    Args:
        joints: Those there are.
        names: Those that are wanted.
        model: The compiled model, to tell a joint of another kind from a wrong name.

    Raises:
        UnknownName: There is no such joint.
        PluginError: It is a ball or a free joint.
    """
    found = []
    for name in names:
        if name not in joints:
            if name and "\0" not in name and mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) >= 0:
                raise PluginError(f"joint {name!r} is neither a hinge nor a slide, so it has no single position")
            raise UnknownName("joint", name, joints)
        found.append(joints[name])
    return found


def each_once(names: tuple[str, ...]) -> tuple[str, ...]:
    """Returns the names, if none comes twice.

    Raises:
        ValueError: One does.
    """
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ValueError(f"each joint can be listed once only, and {', '.join(map(repr, twice))} comes twice")
    return names
