"""In which frame the model says that a sensor measures."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug_plugins.sensors.found import Sensor, Source

Array = NDArray[np.float64]

_IN_THE_WORLD = {
    "framepos", "framelinvel", "frameangvel", "framelinacc", "frameangacc", "framexaxis", "frameyaxis", "framezaxis",
    "subtreecom", "subtreelinvel", "subtreeangmom", "geomnormal",
}  # fmt: skip
"""Sensors whose numbers are in the world's axes, unless they have a reference."""

_OPTICAL = np.array((0.0, 1.0, 0.0, 0.0))
"""Between MuJoCo's camera and ROS's optical frame, in either direction."""

_NOWHERE = -1


def frame_of(model: mujoco.MjModel, sensor: Sensor, world: str) -> str:
    """Returns the frame of a sensor's numbers.

    Args:
        model: The compiled model.
        sensor: The sensor.
        world: What the world's frame is called.
    """
    source = sensor.main
    if sensor.kind == "rangefinder":
        # A Range looks along x, a site along z, so the site's frame will not do.
        return f"{source.name}_frame"
    if source.type not in _IN_THE_WORLD and sensor.kind != "orientation":
        kind, which = int(model.sensor_objtype[source.sensor]), int(model.sensor_objid[source.sensor])
        return _name(model, kind, which) or sensor.name
    reference = int(model.sensor_refid[source.sensor])
    if reference == _NOWHERE:
        return world
    return _name(model, int(model.sensor_reftype[source.sensor]), reference) or world


def reference_in_frame(model: mujoco.MjModel, source: Source) -> tuple[Array, Array] | None:
    """Returns where a sensor's reference is in the frame that is called like it, if that is another place.

    MuJoCo's camera looks along -z, its frame of that name along z; `reftype="body"` is the frame of the body's inertia.

    Args:
        model: The compiled model.
        source: The sensor.

    Returns:
        Position [m], shape (3,), and turn (w, x, y, z), shape (4,); a position only for a sensor that has a place.
    """
    which = int(model.sensor_refid[source.sensor])
    if source.type not in _IN_THE_WORLD | {"framequat"} or which == _NOWHERE:
        return None
    kind = int(model.sensor_reftype[source.sensor])
    if kind == int(mujoco.mjtObj.mjOBJ_CAMERA):
        return np.zeros(3), _OPTICAL.copy()
    if kind != int(mujoco.mjtObj.mjOBJ_BODY):
        return None
    shift = model.body_ipos[which].copy() if source.type == "framepos" else np.zeros(3)
    turn = model.body_iquat[which].copy()
    return (shift, turn) if shift.any() or turn[1:].any() else None


def disagreement(model: mujoco.MjModel, sensor: Sensor) -> str:
    """Returns a sentence if the parts of a sensor cannot be one message, as they are not at one place; else nothing.

    The orientation of an imu may be that of the body that its site is on.
    """
    if sensor.kind == "pose":
        about = [model.sensor_objtype, model.sensor_objid, model.sensor_reftype, model.sensor_refid]
    else:
        about = [model.sensor_objtype, model.sensor_objid]
    parts = [part for part in sensor.parts.values() if sensor.kind != "imu" or part.size == 3]
    places = {tuple(int(ids[part.sensor]) for ids in about) for part in parts}
    if len(places) == 1:
        return ""
    what = "objects or references" if sensor.kind == "pose" else "sites"
    return f"{sensor.kind} {sensor.name!r}: {' and '.join(part.name for part in parts)} have different {what}"


def _name(model: mujoco.MjModel, kind: int, which: int) -> str:
    """Returns the name of an object, where frames are called like it."""
    if which == _NOWHERE:
        return ""
    if kind == int(mujoco.mjtObj.mjOBJ_JOINT):
        # A ball joint turns in the axes of the body that it moves.
        kind, which = int(mujoco.mjtObj.mjOBJ_BODY), int(model.jnt_bodyid[which])
    name = mujoco.mj_id2name(model, kind, which) or ""
    return f"{name}_frame" if name and kind == int(mujoco.mjtObj.mjOBJ_CAMERA) else name
