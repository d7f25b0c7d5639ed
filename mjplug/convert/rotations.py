"""Rotations and poses as URDF and MJCF write them.

Quaternions are (w, x, y, z); matrices turn child axes to parent axes.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

IDENTITY: Array = np.eye(4)


def from_rpy(rpy: Sequence[float]) -> Array:
    """Returns the matrix of roll, pitch and yaw about the fixed x, y and z axes [rad], shape (3, 3)."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(rpy), np.cos(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def pose(xyz: Sequence[float], rpy: Sequence[float]) -> Array:
    """Returns the homogeneous matrix of an `<origin>`, shape (4, 4)."""
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = from_rpy(rpy), xyz
    return result


def about_axis(axis: Sequence[float] | Array, angle: float) -> Array:
    """Returns the matrix of a rotation about a unit axis [rad], shape (3, 3)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    result: Array = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    return result


def quaternion(matrix: Array) -> Array:
    """Returns the unit quaternion of a rotation matrix, with its largest part positive, shape (4,)."""
    m = matrix
    trace = np.trace(m)
    parts = np.array([trace, m[0, 0], m[1, 1], m[2, 2]])
    k = int(np.argmax(parts))
    if k == 0:
        q = np.array([1.0 + trace, m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
    else:
        i, j, k = k - 1, k % 3, (k + 1) % 3
        q = np.empty(4)
        q[0] = m[k, j] - m[j, k]
        q[1 + i] = 1.0 + m[i, i] - m[j, j] - m[k, k]
        q[1 + j] = m[j, i] + m[i, j]
        q[1 + k] = m[k, i] + m[i, k]
    result: Array = q / np.linalg.norm(q)
    return result


def numbers(values: Sequence[float] | Array, digits: int = 12) -> str:
    """Returns numbers as an MJCF attribute, rounded to `digits` digits after the point; -0 becomes 0."""
    return " ".join(f"{round(float(value), digits) + 0.0:.15g}" for value in values)


def exactly(values: Sequence[float] | Array) -> str:
    """Returns numbers as an MJCF attribute with all their digits."""
    return " ".join(repr(float(value) + 0.0).removesuffix(".0") for value in values)


def pose_attributes(matrix: Array) -> dict[str, str]:
    """Returns `pos` and `quat` of a pose; those of the identity are left out."""
    result = {}
    position, quat = numbers(matrix[:3, 3]), numbers(quaternion(matrix[:3, :3]), 15)
    if position != "0 0 0":
        result["pos"] = position
    if quat != "1 0 0 0":
        result["quat"] = quat
    return result
