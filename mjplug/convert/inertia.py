"""Inertias that physics allows: principal moments, and the smallest change that makes an impossible tensor possible."""

import numpy as np

from mjplug.convert.report import Report
from mjplug.convert.robot import Inertial
from mjplug.convert.rotations import Array, exactly, numbers, quaternion

_SMALLEST = 1e-7
"""Smallest principal moment per kilogram [m²]: that of a ball with a radius of 0.5 mm."""

_TOLERANCE = 1e-9


def principal(inertial: Inertial, link: str, report: Report) -> tuple[Array, Array]:
    """Returns the principal moments, shape (3,), and the rotation of their axes in the link, shape (3, 3).

    Moments that no body can have are changed: each becomes at least 1e-7 m² times the mass; then the two smaller ones
    are raised by the same amount until their sum is the largest.
    """
    tensor = inertial.pose[:3, :3] @ inertial.tensor @ inertial.pose[:3, :3].T
    moments, axes = np.linalg.eigh((tensor + tensor.T) / 2.0)
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] = -axes[:, 0]
    given = moments.copy()
    moments = np.maximum(moments, _SMALLEST * inertial.mass)
    missing = moments[2] - moments[0] - moments[1]
    if missing > _TOLERANCE * moments[2]:
        moments[:2] += missing / 2.0
    if np.any(moments != given):
        before, after = (" ".join(f"{value:.3g}" for value in some) for some in (given, moments))
        report.add("repair", "impossible inertia", link, f"principal moments {before} -> {after} kg m²")
    return moments, axes


def inertial_attributes(inertial: Inertial, link: str, report: Report) -> dict[str, str]:
    """Returns the attributes of MJCF's `<inertial>`."""
    moments, axes = principal(inertial, link, report)
    # MuJoCo refuses A + B < C also where it is a matter of rounding.
    moments[2] = min(moments[2], moments[0] + moments[1])
    return {
        "mass": exactly([inertial.mass]),
        "pos": numbers(inertial.pose[:3, 3]),
        "quat": exactly(quaternion(axes)),
        "diaginertia": exactly(moments),
    }
