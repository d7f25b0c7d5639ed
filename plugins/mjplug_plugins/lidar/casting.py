"""Casts many rays at once with the same results as `mj_ray`.

`mj_multiRay` on the original model misses geoms. It tests a bounding sphere of each body first, but that sphere
contains only the colliding geoms, and its centre does not rotate with the body. It also treats a plane as if it were
only at its origin. The spheres and the assignment of geoms to bodies are stored in the model, so this module casts rays
in a copy of the model with corrected spheres.
"""

import copy
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

INFINITE_RADIUS = 1e10
"""Bounding radius of geoms without an end, such as planes [m]; MuJoCo's largest number."""

_MIN_GEOMS_FOR_SPHERE = 3
"""A bounding sphere saves time for bodies with at least this many geoms; MuJoCo tests the angles of each geom too."""

_RAYS_PER_THREAD = 1024
"""Number of rays for which one more thread saves time."""

_GROUPS = np.array([1, 0, 0, 0, 0, 0], np.uint8)


class Caster:
    """Casts rays in states of one model.

    Args:
        model: The compiled model; it is not changed.
        threads: Number of threads; each uses its own mjData.
    """

    def __init__(self, model: mujoco.MjModel, threads: int = 1) -> None:
        self._model = casting_model(model)
        self._current_groups: NDArray[np.int32] | None = None
        self._extra_data = [mujoco.MjData(self._model) for _ in range(threads - 1)]
        self._pool = ThreadPoolExecutor(threads - 1) if threads > 1 else None

    def pose(self, data: mujoco.MjData) -> None:
        """Sets the state to cast rays in: current kinematics, which must not change while rays are cast."""
        self._data = data
        for other in self._extra_data:
            other.geom_xpos[:] = data.geom_xpos
            other.geom_xmat[:] = data.geom_xmat
            other.xipos[:] = data.xipos

    def cast(
        self,
        origin: Array,
        rays: Array,
        groups: NDArray[np.int32],
        cutoff: float,
        distances: Array,
        geoms: NDArray[np.int32],
    ) -> None:
        """Casts rays from one point.

        Args:
            origin: The point in the world frame, shape (3,) [m].
            rays: Directions of the rays, unit vectors in the world frame, shape (n, 3).
            groups: 0 for each visible geom, 1 for the others, shape (ngeom,); the caller must not change it later.
            cutoff: Geoms beyond this distance may be missing from the result [m].
            distances: Output: distance to the nearest geom, -1 for none, shape (n,) [m].
            geoms: Output: ids of these geoms, -1 for none, shape (n,).
        """
        if groups is not self._current_groups:
            self._model.geom_group[:] = groups
            self._current_groups = groups

        def part(data: mujoco.MjData, begin: int, end: int) -> None:
            mujoco.mj_multiRay(
                self._model,
                data,
                origin,
                rays[begin:end].reshape(-1),
                _GROUPS,
                True,
                -1,
                geoms[begin:end],
                distances[begin:end],
                None,
                end - begin,
                cutoff,
            )

        count = len(rays)
        parts = min(1 + len(self._extra_data), max(1, count // _RAYS_PER_THREAD))
        if self._pool is None or parts == 1:
            part(self._data, 0, count)
            return
        edges = [count * i // parts for i in range(parts + 1)]
        waiting = [
            self._pool.submit(part, other, begin, end)
            for other, begin, end in zip(self._extra_data, edges[1:], edges[2:], strict=False)
        ]
        part(self._data, edges[0], edges[1])
        for future in waiting:
            future.result()

    def close(self) -> None:
        """Stops the threads."""
        if self._pool is not None:
            self._pool.shutdown()


def casting_model(model: mujoco.MjModel) -> mujoco.MjModel:
    """Returns a copy in which `mj_multiRay` finds what `mj_ray` finds; use the copy for ray casting only."""
    model = copy.copy(model)
    roots = model.body_bvhadr.copy()
    endless = (model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE) | (model.geom_rbound <= 0)
    model.geom_rbound[endless] = INFINITE_RADIUS
    # MuJoCo's angle bounds are exact; the margin makes a ray along an edge independent of rounding.
    model.geom_aabb[:, 3:] += 1e-9 * (1.0 + model.geom_aabb[:, 3:])
    if not (roots >= 0).any():
        # Without bounding volumes, MuJoCo tests every geom.
        return model
    nodes = {int(body): int(roots[body]) for body in np.flatnonzero(roots >= 0)}
    radii = _radii(model)
    alone = {
        body for body in nodes if model.body_geomnum[body] >= _MIN_GEOMS_FOR_SPHERE and radii[body] < INFINITE_RADIUS
    }
    # The bodies without their own sphere share one node.
    spare = next((body for body in nodes if body not in alone), None)
    if spare is None:
        spare = next(iter(alone))
        alone.remove(spare)
    shared = nodes[spare]
    model.bvh_aabb[shared] = (0, 0, 0, INFINITE_RADIUS, 0, 0)
    numbers, model.body_geomnum[:], model.body_bvhadr[:] = model.body_geomnum.copy(), 0, -1
    for first, start, count in _runs(numbers, alone):
        model.body_geomadr[first], model.body_geomnum[first] = start, count
        model.body_bvhadr[first] = nodes[first] if first in alone else shared
        if first in alone:
            model.bvh_aabb[nodes[first]] = (0, 0, 0, radii[first], 0, 0)
    return model


def _radii(model: mujoco.MjModel) -> Array:
    """Returns the radius of each body's geoms around its centre of mass, the sphere's centre, shape (nbody,) [m]."""
    radii = np.zeros(model.nbody)
    offsets = np.linalg.norm(model.geom_pos - model.body_ipos[model.geom_bodyid], axis=1)
    np.maximum.at(radii, model.geom_bodyid, (offsets + model.geom_rbound) * (1.0 + 1e-9) + 1e-9)
    return radii


def _runs(numbers: NDArray[np.int32], alone: set[int]) -> Iterator[tuple[int, int, int]]:
    """Yields the geoms to assign to each body: body id, first geom id and number of geoms.

    The geoms of a model are in the order of their bodies. Each body in `alone` keeps its own geoms. The geoms of other
    consecutive bodies are joined.
    """
    first, start, count = -1, 0, 0
    for body, number in enumerate(numbers.tolist()):
        if body in alone:
            if count:
                yield first, start, count
            yield body, start + count, number
            first, start, count = -1, start + count + number, 0
        elif number:
            first = body if first < 0 else first
            count += number
    if count:
        yield first, start, count
