"""The exact values of a sensor, without noise."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug_plugins.sensors.model_sensors import Sensor, Source

_GRAVITY = int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)


def exact_values(model: mujoco.MjModel, data: mujoco.MjData, sensor: Sensor) -> dict[str, NDArray[np.float64]]:
    """Returns the values of each part by its role, as views that change with the state, shape (size,).

    MuJoCo returns 0 for an accelerometer on a fixed body; here it measures the reaction to gravity, as a real one does.
    """
    values = {}
    for role, source in sensor.parts.items():
        if source.type == "accelerometer" and _is_fixed(model, source):
            values[role] = _at_rest(model, data, source)
        else:
            values[role] = data.sensordata[source.begin : source.begin + source.size]
    return values


def _is_fixed(model: mujoco.MjModel, source: Source) -> bool:
    body = int(model.site_bodyid[model.sensor_objid[source.sensor]])
    return not model.body_weldid[body] and model.body_mocapid[model.body_rootid[body]] < 0


def _at_rest(model: mujoco.MjModel, data: mujoco.MjData, source: Source) -> NDArray[np.float64]:
    if model.opt.disableflags & _GRAVITY:
        return np.zeros(3)
    rotation = data.site_xmat[model.sensor_objid[source.sensor]].reshape(3, 3)
    reading: NDArray[np.float64] = rotation.T @ -model.opt.gravity
    cutoff = float(model.sensor_cutoff[source.sensor])
    return np.clip(reading, -cutoff, cutoff) if cutoff else reading
