"""In which frame the model says that a sensor measures."""

import mujoco

from mjplug_plugins.sensors.found import Sensor

_IN_THE_WORLD = {
    "framepos", "framelinvel", "frameangvel", "framelinacc", "frameangacc", "framexaxis", "frameyaxis", "framezaxis",
    "subtreecom", "subtreelinvel", "subtreeangmom", "geomnormal",
}  # fmt: skip
"""Sensors whose numbers are in the world's axes, unless they have a reference."""

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
        return f"{sensor.name}_frame"
    if source.type not in _IN_THE_WORLD:
        kind, which = int(model.sensor_objtype[source.sensor]), int(model.sensor_objid[source.sensor])
        return _name(model, kind, which) or sensor.name
    reference = int(model.sensor_refid[source.sensor])
    if reference == _NOWHERE:
        return world
    return _name(model, int(model.sensor_reftype[source.sensor]), reference) or world


def _name(model: mujoco.MjModel, kind: int, which: int) -> str:
    """Returns the name of an object, where frames are called like it."""
    if which == _NOWHERE:
        return ""
    name = mujoco.mj_id2name(model, kind, which) or ""
    return f"{name}_frame" if name and kind == int(mujoco.mjtObj.mjOBJ_CAMERA) else name
