"""Bodies with a free joint: what the plugins that read or drive them need to know."""

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
        qpos: Where its seven positions begin in `qpos`: position, then quaternion (w, x, y, z).
        dof: Where its six velocities begin in `qvel`: linear in world axes, then angular in the body's own axes.
    """

    name: str
    body: int
    qpos: int
    dof: int


def free_bodies(model: mujoco.MjModel) -> list[FreeBody]:
    """Returns every body with a free joint, in joint order."""
    found = []
    for joint in range(model.njnt):
        if model.jnt_type[joint] == _FREE:
            body = int(model.jnt_bodyid[joint])
            name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body) or ""
            found.append(FreeBody(name, body, int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])))
    return found


def free_body(host: Host, name: str) -> FreeBody:
    """Returns the body of a name.

    Raises:
        UnknownName: The model has no body of that name.
        PluginError: The body has no free joint. Both sentences list those that have one.
    """
    named = {body.name: body for body in free_bodies(host.model) if body.name}
    if name in named:
        return named[name]
    try:
        host.body_id(name)
    except UnknownName:
        raise UnknownName("body with a free joint", name, named) from None
    others = f"bodies with one: {', '.join(sorted(named))}" if named else "no body of the model has one"
    raise PluginError(f"body {name!r} has no free joint; {others}")
