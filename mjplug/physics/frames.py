"""Rotations of vectors and frames. Quaternions are (w, x, y, z), unit length, shape (4,)."""

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def compose(quat_a: Array, quat_b: Array) -> Array:
    """Returns the product `quat_a` · `quat_b`, shape (4,): the rotation by `quat_b`, then by `quat_a`."""
    product = np.empty(4)
    mujoco.mju_mulQuat(product, quat_a, quat_b)
    mujoco.mju_normalize4(product)
    return product


def rotate(quat: Array, vec: Array) -> Array:
    """Returns `vec`, given in the child frame, in the parent frame, shape (3,).

    Args:
        quat: Orientation of the child frame in the parent frame, shape (4,).
        vec: Vector in the child frame, shape (3,).
    """
    rotated = np.empty(3)
    mujoco.mju_rotVecQuat(rotated, vec, quat)
    return rotated


def inverse(quat: Array) -> Array:
    """Returns the inverse of a unit quaternion, shape (4,)."""
    return quat * (1.0, -1.0, -1.0, -1.0)
