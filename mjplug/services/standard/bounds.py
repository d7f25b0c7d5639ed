"""Boxes around entities, and whether they overlap a volume."""

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.errors import RequestError
from mjplug.physics.simulation import Simulation
from mjplug.services.standard.entities import Entity
from mjplug.services.standard.replies import UNSUPPORTED, ResultError
from mjplug_schemas.geometry_msgs import Vector3
from mjplug_schemas.simulation_interfaces import Bounds

Array = NDArray[np.float64]

_PLANE = int(mujoco.mjtGeom.mjGEOM_PLANE)

EMPTY = Bounds(type=Bounds.TYPE_EMPTY)


def corners(
    model: mujoco.MjModel, data: mujoco.MjData, geoms: NDArray[np.int64], position: Array, rotation: Array
) -> tuple[Array, Array] | None:
    """Returns the lowest and the highest coordinates of a box around geoms, in a frame.

    Args:
        model: The model.
        data: The state, with current poses of geoms.
        geoms: Ids of the geoms.
        position: Origin of the frame in the world [m], shape (3,).
        rotation: Axes of the frame in the world, shape (3, 3).

    Returns:
        Two arrays, shape (3,) [m]; None if the geoms have no finite size.
    """
    boxes = model.geom_aabb[geoms].reshape(-1, 6)
    centres, halves = boxes[:, :3].copy(), boxes[:, 3:].copy()
    planes = model.geom_type[geoms] == _PLANE
    if planes.any():
        # The box of a plane in the model is infinite, whatever its size.
        sizes = model.geom_size[geoms]
        halves[planes] = np.c_[sizes[planes, :2], np.zeros(int(planes.sum()))]
        finite = ~planes | (sizes[:, :2] > 0).all(axis=1)
        geoms, centres, halves = geoms[finite], centres[finite], halves[finite]
    if not len(geoms):
        return None
    turns = rotation.T @ data.geom_xmat[geoms].reshape(-1, 3, 3)
    middle = (data.geom_xpos[geoms] - position) @ rotation + np.einsum("nij,nj->ni", turns, centres)
    extent = np.einsum("nij,nj->ni", np.abs(turns), halves)
    return (middle - extent).min(axis=0), (middle + extent).max(axis=0)


def bounds_of(simulation: Simulation, entity: Entity) -> Bounds:
    """Returns a box around an entity in the frame of its canonical link; it may be larger than the smallest one."""
    simulation.kinematics()
    model, data = simulation.model, simulation.data
    rotation = data.xmat[entity.body].reshape(3, 3)
    found = corners(model, data, entity.geoms, data.xpos[entity.body], rotation)
    return EMPTY if found is None else box(*found)


def box(low: Array, high: Array) -> Bounds:
    """Returns a box; its first point is the upper right corner."""
    points = (vector(high), vector(low))
    return Bounds(type=Bounds.TYPE_BOX, points=points)


def vector(values: Array) -> Vector3:
    """Returns three numbers as a message."""
    x, y, z = values.tolist()
    return Vector3(x=x, y=y, z=z)


class Volume:
    """The volume of a filter, in the world frame.

    Args:
        bounds: A box or a sphere.

    Raises:
        RequestError: It is no valid box or sphere.
    """

    def __init__(self, bounds: Bounds) -> None:
        if bounds.type == Bounds.TYPE_CONVEX_HULL:
            raise ResultError(UNSUPPORTED, "bounds.type is 2 (convex hull); a box (1) or a sphere (3) is supported")
        if bounds.type not in (Bounds.TYPE_BOX, Bounds.TYPE_SPHERE):
            raise RequestError(f"bounds.type is {bounds.type}; it must be 0 (none), 1 (box) or 3 (sphere)")
        points = np.array([(point.x, point.y, point.z) for point in bounds.points]).reshape(-1, 3)
        if len(points) != 2 or not np.isfinite(points[0]).all():
            raise RequestError(f"bounds.points has {len(points)} points; two finite points are needed")
        self._radius: float | None = None
        if bounds.type == Bounds.TYPE_SPHERE:
            self._radius = float(points[1][0])
            if not math.isfinite(self._radius) or self._radius < 0:
                raise RequestError(f"the radius in bounds.points[1].x is {self._radius:g}; it must not be negative")
            self._low = self._high = points[0]
        elif not np.isfinite(points).all():
            raise RequestError("bounds.points contains a number that is not finite")
        else:
            self._low, self._high = points.min(axis=0), points.max(axis=0)

    def overlaps(self, low: Array, high: Array) -> bool:
        """Returns whether the volume and a box have a point in common."""
        if self._radius is None:
            return bool((low <= self._high).all() and (high >= self._low).all())
        nearest = np.clip(self._low, low, high)
        return float(np.linalg.norm(nearest - self._low)) <= self._radius
