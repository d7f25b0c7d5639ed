"""The names and limits of a model, as JSON values."""

from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

_JOINT_TYPES = {int(kind): kind.name.removeprefix("mjJNT_").lower() for kind in mujoco.mjtJoint.__members__.values()}

_AT_JOINT = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))


def numbers(values: ArrayLike) -> Any:
    """Returns numbers as (nested) lists for JSON; a number that is NaN or infinite becomes None."""
    array = np.asarray(values)
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        array = array.astype(object)
        array[~np.isfinite(np.asarray(values))] = None
    return array.tolist()


def names(model: mujoco.MjModel, kind: mujoco.mjtObj, count: int) -> list[str]:
    """Returns the names of all objects of a kind; an unnamed one has an empty name."""
    return [mujoco.mj_id2name(model, kind, index) or "" for index in range(count)]


def catalogue(model: mujoco.MjModel) -> dict[str, Any]:
    """Returns the names and limits of bodies, joints, actuators, cameras and keyframes, each in the model's order.

    Joint limits are in rad or m, control limits in the actuator's unit; None means unlimited. The joint of an actuator
    is its id; None if the actuator does not act on a joint.
    """
    obj = mujoco.mjtObj
    return {
        "bodies": names(model, obj.mjOBJ_BODY, model.nbody),
        "joints": [
            {
                "name": name,
                "type": _JOINT_TYPES[int(model.jnt_type[joint])],
                "body": int(model.jnt_bodyid[joint]),
                "range": numbers(model.jnt_range[joint]) if model.jnt_limited[joint] else None,
            }
            for joint, name in enumerate(names(model, obj.mjOBJ_JOINT, model.njnt))
        ],
        "actuators": _actuators(model),
        "cameras": names(model, obj.mjOBJ_CAMERA, model.ncam),
        "keyframes": names(model, obj.mjOBJ_KEY, model.nkey),
    }


def _actuators(model: mujoco.MjModel) -> list[dict[str, Any]]:
    count = len(model.actuator_trntype)
    # Before 3.17, every actuator has one control.
    first = getattr(model, "actuator_ctrladr", np.arange(count))
    number = getattr(model, "actuator_ctrlnum", np.ones(count, int))
    limits = np.reshape(model.actuator_ctrlrange, (-1, 2))
    limited = np.ravel(model.actuator_ctrllimited)
    return [
        {
            "name": name,
            "joint": int(model.actuator_trnid[actuator][0]) if model.actuator_trntype[actuator] in _AT_JOINT else None,
            "controls": [
                numbers(limits[control]) if limited[control] else None
                for control in range(first[actuator], first[actuator] + number[actuator])
            ],
        }
        for actuator, name in enumerate(names(model, mujoco.mjtObj.mjOBJ_ACTUATOR, count))
    ]
