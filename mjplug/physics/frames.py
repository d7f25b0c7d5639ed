"""Rotations and poses, as plain arrays: quaternions are (w, x, y, z), unit length."""

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def compose(quat_a: Array, quat_b: Array) -> Array:
    """Returns the unit quaternion of rotation `quat_b` followed by `quat_a`."""
    product = np.empty(4)
    mujoco.mju_mulQuat(product, quat_a, quat_b)
    mujoco.mju_normalize4(product)
    return product


def rotate(quat: Array, vec: Array) -> Array:
    """Rotates `vec`, shape (3,), from the child frame to the parent frame; `quat` is the child's orientation."""
    rotated = np.empty(3)
    mujoco.mju_rotVecQuat(rotated, vec, quat)
    return rotated


def inverse(quat: Array) -> Array:
    """Returns the inverse of a unit quaternion."""
    return quat * (1.0, -1.0, -1.0, -1.0)
