"""Converts vectors and orientations of requests to validated arrays. Quaternions are (w, x, y, z), unit length."""

import mujoco
import numpy as np

from mjplug.errors import RequestError
from mjplug.physics.frames import Array
from mjplug_schemas.geometry_msgs import Point, Quaternion, Vector3

_MIN_NORM = 1e-9


def vector(value: Vector3 | Point, what: str) -> Array:
    """Returns the components (x, y, z) of a message, shape (3,), in the message's unit and frame.

    Args:
        value: The message.
        what: The name of its field, for the error message.

    Raises:
        RequestError: A component is NaN or infinite, or its absolute value is 1e10 or more.
    """
    array = np.array((value.x, value.y, value.z))
    if not np.isfinite(array).all():
        raise RequestError(f"{what} is ({value.x:g}, {value.y:g}, {value.z:g}); every component must be finite")
    if np.abs(array).max() >= mujoco.mjMAXVAL:
        raise RequestError(
            f"{what} is ({value.x:g}, {value.y:g}, {value.z:g}); "
            f"the absolute value of every component must be below {mujoco.mjMAXVAL:g}"
        )
    return array


def unit_quat_wxyz(value: Quaternion, what: str) -> Array:
    """Returns a message's orientation as a unit quaternion (w, x, y, z), shape (4,), in the message's frame.

    Args:
        value: The message; its norm need not be 1.
        what: The name of its field, for the error message.

    Raises:
        RequestError: A component is NaN or infinite, or the norm is zero.
    """
    quat = np.array((value.w, value.x, value.y, value.z))
    # Scaling first prevents overflow and underflow in the norm.
    largest = float(np.abs(quat).max())
    if not np.isfinite(largest) or largest < _MIN_NORM:
        raise RequestError(
            f"{what} is (x {value.x:g}, y {value.y:g}, z {value.z:g}, w {value.w:g}); "
            "a quaternion must be finite and its norm must not be zero"
        )
    quat /= largest
    mujoco.mju_normalize4(quat)
    return quat
