"""Hinges and slides: the joints that a JointState message can contain."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TypeVar

import mujoco

from mjplug.plugin import PluginError, UnknownName

J = TypeVar("J")

_SCALAR = {int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)}


@dataclass(frozen=True, slots=True)
class ScalarJoint:
    """A hinge or a slide.

    Attributes:
        name: Its name.
        joint: Its id.
        qpos: Its index in `qpos` [rad or m].
        dof: Its index in `qvel` [rad/s or m/s] and in the force arrays [N·m or N].
    """

    name: str
    joint: int
    qpos: int
    dof: int

    def position(self, data: mujoco.MjData) -> float:
        """Returns its position [rad or m]."""
        return float(data.qpos[self.qpos])

    def velocity(self, data: mujoco.MjData) -> float:
        """Returns its velocity [rad/s or m/s]."""
        return float(data.qvel[self.dof])


def scalar_joints(model: mujoco.MjModel) -> dict[str, ScalarJoint]:
    """Returns the hinges and slides with a name, by name, in the order of the model."""
    joints = {}
    for joint in range(model.njnt):
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, joint)
        if name and int(model.jnt_type[joint]) in _SCALAR:
            joints[name] = ScalarJoint(name, joint, int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint]))
    return joints


def chosen(joints: Mapping[str, J], names: Iterable[str], model: mujoco.MjModel) -> list[J]:
    """Returns the joints with the given names, in the order of the names.

    Args:
        joints: All hinges and slides, by name.
        names: The names to select.
        model: The compiled model, to distinguish a joint of another type from an unknown name.

    Raises:
        UnknownName: The model has no such joint.
        PluginError: The joint is a ball joint or a free joint.
    """
    selected = []
    for name in names:
        if name not in joints:
            if name and "\0" not in name and mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) >= 0:
                if int(model.joint(name).type[0]) in _SCALAR:
                    raise PluginError(f"joint {name!r} is on the other side of its transmission; set `side`")
                raise PluginError(f"joint {name!r} is neither a hinge nor a slide; only these joints are supported")
            raise UnknownName("joint", name, joints)
        selected.append(joints[name])
    return selected


def require_unique(names: tuple[str, ...]) -> tuple[str, ...]:
    """Returns the names if each is listed once.

    Raises:
        ValueError: A name is listed twice.
    """
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ValueError(f"list each joint once; listed twice: {', '.join(map(repr, twice))}")
    return names
