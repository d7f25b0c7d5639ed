"""Bodies with a free joint: their ids and their indices in the state."""

from dataclasses import dataclass

import mujoco

from mjplug.plugin import Host, PluginError, UnknownName

_FREE = int(mujoco.mjtJoint.mjJNT_FREE)


@dataclass(frozen=True, slots=True)
class FreeBody:
    """A body with a free joint.

    Attributes:
        name: Its name; empty if it has none.
        body: Its id.
        qpos: Start index of its seven values in `qpos`: position [m], then quaternion (w, x, y, z).
        dof: Start index of its six values in `qvel`: linear in world axes [m/s], angular in body axes [rad/s].
    """

    name: str
    body: int
    qpos: int
    dof: int


def free_bodies(model: mujoco.MjModel) -> list[FreeBody]:
    """Returns every body with a free joint, in joint order."""
    bodies = []
    for joint in range(model.njnt):
        if model.jnt_type[joint] == _FREE:
            body = int(model.jnt_bodyid[joint])
            name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body) or ""
            bodies.append(FreeBody(name, body, int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])))
    return bodies


def free_body(host: Host, name: str) -> FreeBody:
    """Returns the body with a free joint of the given name.

    Raises:
        UnknownName: The model has no body of that name.
        PluginError: The body has no free joint. Both messages list the bodies with a free joint.
    """
    named = {body.name: body for body in free_bodies(host.model) if body.name}
    if name in named:
        return named[name]
    try:
        host.body_id(name)
    except UnknownName:
        raise UnknownName("body with a free joint", name, named) from None
    others = f"bodies with a free joint: {', '.join(sorted(named))}" if named else "no body of the model has one"
    raise PluginError(f"body {name!r} has no free joint; {others}")
