"""Vectors and orientations of requests, checked, as arrays: quaternions are (w, x, y, z), unit length."""

import mujoco
import numpy as np

from mjplug.errors import RequestError
from mjplug.physics.frames import Array
from mjplug_schemas.geometry_msgs import Point, Quaternion, Vector3

_SMALLEST_NORM = 1e-9


def vector(value: Vector3 | Point, what: str) -> Array:
    """Returns the three components of a message, shape (3,).

    Raises:
        RequestError: One of them is NaN, infinite or beyond 1e10; `what` names the field in the sentence.
    """
    array = np.array((value.x, value.y, value.z))
    if not np.isfinite(array).all():
        raise RequestError(f"{what} is ({value.x:g}, {value.y:g}, {value.z:g}); every component must be finite")
    if np.abs(array).max() >= mujoco.mjMAXVAL:
        raise RequestError(
            f"{what} is ({value.x:g}, {value.y:g}, {value.z:g}); MuJoCo takes no component beyond {mujoco.mjMAXVAL:g}"
        )
    return array


def unit_quat_wxyz(value: Quaternion, what: str) -> Array:
    """Returns a message's orientation as a unit quaternion (w, x, y, z), shape (4,).

    Raises:
        RequestError: A component is NaN or infinite, or the norm is zero; `what` names the field in the sentence.
    """
    quat = np.array((value.w, value.x, value.y, value.z))
    # Scaled first, so that neither huge nor tiny components over- or underflow in the norm.
    largest = float(np.abs(quat).max())
    if not np.isfinite(largest) or largest < _SMALLEST_NORM:
        raise RequestError(
            f"{what} is (x {value.x:g}, y {value.y:g}, z {value.z:g}, w {value.w:g}); "
            "a quaternion must be finite and its norm must not be zero"
        )
    quat /= largest
    mujoco.mju_normalize4(quat)
    return quat
