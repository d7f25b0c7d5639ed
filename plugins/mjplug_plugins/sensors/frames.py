"""The frame of a sensor's values according to the model."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug_plugins.sensors.model_sensors import Sensor, Source

Array = NDArray[np.float64]

_WORLD_FRAME_TYPES = {
    "framepos", "framelinvel", "frameangvel", "framelinacc", "frameangacc", "framexaxis", "frameyaxis", "framezaxis",
    "subtreecom", "subtreelinvel", "subtreeangmom", "geomnormal",
}  # fmt: skip
"""Sensor types whose values are in world axes if they have no reference."""

_OPTICAL = np.array((0.0, 1.0, 0.0, 0.0))
"""Rotation between MuJoCo's camera frame and ROS's optical frame, in both directions (w, x, y, z)."""

_NO_REFERENCE = -1


def frame_of(model: mujoco.MjModel, sensor: Sensor, world: str) -> str:
    """Returns the name of the frame of a sensor's values.

    Args:
        model: The compiled model.
        sensor: The sensor.
        world: Name of the world frame.
    """
    source = sensor.main
    if sensor.kind == "rangefinder":
        # A Range message measures along x, the site along z, so the site's frame cannot be used.
        return f"{source.name}_frame"
    if source.type not in _WORLD_FRAME_TYPES and sensor.kind != "orientation":
        kind, which = int(model.sensor_objtype[source.sensor]), int(model.sensor_objid[source.sensor])
        return _name(model, kind, which) or sensor.name
    reference = int(model.sensor_refid[source.sensor])
    if reference == _NO_REFERENCE:
        return world
    return _name(model, int(model.sensor_reftype[source.sensor]), reference) or world


def reference_in_frame(model: mujoco.MjModel, source: Source) -> tuple[Array, Array] | None:
    """Returns the pose of a sensor's reference in the TF frame of the same object, if they differ.

    They differ for cameras (MuJoCo: -z forward, TF: z forward) and for `reftype="body"` (the inertial frame).

    Args:
        model: The compiled model.
        source: The MJCF sensor.

    Returns:
        Position, shape (3,) [m], and rotation (w, x, y, z), shape (4,); the position is zero for directions.
    """
    which = int(model.sensor_refid[source.sensor])
    if source.type not in _WORLD_FRAME_TYPES | {"framequat"} or which == _NO_REFERENCE:
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
    """Returns a message if the parts of a sensor have different sites or references; else an empty string.

    The orientation of an imu may be that of the body of its site.
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
    """Returns the frame name of an object; empty if it has no name."""
    if which == _NO_REFERENCE:
        return ""
    if kind == int(mujoco.mjtObj.mjOBJ_JOINT):
        # The frame of a ball joint is the frame of the body that it moves.
        kind, which = int(mujoco.mjtObj.mjOBJ_BODY), int(model.jnt_bodyid[which])
    name = mujoco.mj_id2name(model, kind, which) or ""
    return f"{name}_frame" if name and kind == int(mujoco.mjtObj.mjOBJ_CAMERA) else name
