"""Casts many rays at once, each with the result of `mj_ray`.

`mj_multiRay` alone misses geoms: the sphere around a body, from which it tells whether a ray may meet it, is that of
its colliding geoms only, and its centre is not turned with the body; and a plane counts as far away as its origin. The
spheres, and which geoms are whose, are data of the model. So rays are cast in a copy whose data say what is true.
"""

import copy
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

EVERYWHERE = 1e10
"""Radius of what has no end [m]; MuJoCo's own largest number."""

_WORTH_A_SPHERE = 3
"""Geoms of a body from which on a sphere around them saves time; MuJoCo tests the angles of each geom besides."""

_WORTH_A_THREAD = 1024
"""Rays from which on a further thread saves time."""

_GROUPS = np.array([1, 0, 0, 0, 0, 0], np.uint8)


class Caster:
    """Casts rays into states of one model.

    Args:
        model: The model; it is left as it is.
        threads: How many cast at the same time, each with an mjData of its own.
    """

    def __init__(self, model: mujoco.MjModel, threads: int = 1) -> None:
        self._model = casting_model(model)
        self._shown: NDArray[np.int32] | None = None
        self._others = [mujoco.MjData(self._model) for _ in range(threads - 1)]
        self._pool = ThreadPoolExecutor(threads - 1) if threads > 1 else None

    def pose(self, data: mujoco.MjData) -> None:
        """Takes up a state, with its kinematics; `data` must stay as it is while rays are cast."""
        self._data = data
        for other in self._others:
            other.geom_xpos[:] = data.geom_xpos
            other.geom_xmat[:] = data.geom_xmat
            other.xipos[:] = data.xipos

    def cast(
        self,
        origin: Array,
        rays: Array,
        groups: NDArray[np.int32],
        farthest: float,
        distances: Array,
        geoms: NDArray[np.int32],
    ) -> None:
        """Casts rays from one point.

        Args:
            origin: The point, shape (3,), in the world [m].
            rays: Their directions, shape (n, 3), unit vectors in the world.
            groups: 0 for each geom that is seen, 1 for the others, shape (ngeom,); not to be written to later.
            farthest: What is farther may be found or not [m].
            distances: Gets the distance to the nearest geom, -1 for none, shape (n,) [m].
            geoms: Gets the ids of these geoms, -1 for none, shape (n,).
        """
        if groups is not self._shown:
            self._model.geom_group[:] = groups
            self._shown = groups

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
                farthest,
            )

        count = len(rays)
        parts = min(1 + len(self._others), max(1, count // _WORTH_A_THREAD))
        if self._pool is None or parts == 1:
            part(self._data, 0, count)
            return
        edges = [count * i // parts for i in range(parts + 1)]
        waiting = [
            self._pool.submit(part, other, begin, end)
            for other, begin, end in zip(self._others, edges[1:], edges[2:], strict=False)
        ]
        part(self._data, edges[0], edges[1])
        for future in waiting:
            future.result()

    def close(self) -> None:
        """Ends the threads."""
        if self._pool is not None:
            self._pool.shutdown()


def casting_model(model: mujoco.MjModel) -> mujoco.MjModel:
    """Returns a copy in which `mj_multiRay` finds what `mj_ray` finds; it is of no other use."""
    model = copy.copy(model)
    roots = model.body_bvhadr.copy()
    endless = (model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE) | (model.geom_rbound <= 0)
    model.geom_rbound[endless] = EVERYWHERE
    # What bounds a geom's angles is cut as close as possible; a ray along an edge must not depend on rounding.
    model.geom_aabb[:, 3:] += 1e-9 * (1.0 + model.geom_aabb[:, 3:])
    if not (roots >= 0).any():
        # Without any such data, MuJoCo tries every geom.
        return model
    nodes = {int(body): int(roots[body]) for body in np.flatnonzero(roots >= 0)}
    radii = _radii(model)
    alone = {body for body in nodes if model.body_geomnum[body] >= _WORTH_A_SPHERE and radii[body] < EVERYWHERE}
    # One node must be left for the bodies without a sphere of their own.
    spare = next((body for body in nodes if body not in alone), None)
    if spare is None:
        spare = next(iter(alone))
        alone.remove(spare)
    shared = nodes[spare]
    model.bvh_aabb[shared] = (0, 0, 0, EVERYWHERE, 0, 0)
    numbers, model.body_geomnum[:], model.body_bvhadr[:] = model.body_geomnum.copy(), 0, -1
    for first, start, count in _runs(numbers, alone):
        model.body_geomadr[first], model.body_geomnum[first] = start, count
        model.body_bvhadr[first] = nodes[first] if first in alone else shared
        if first in alone:
            model.bvh_aabb[nodes[first]] = (0, 0, 0, radii[first], 0, 0)
    return model


def _radii(model: mujoco.MjModel) -> Array:
    """Returns how far the geoms of each body reach from its centre of mass, where MuJoCo puts its sphere [m]."""
    radii = np.zeros(model.nbody)
    away = np.linalg.norm(model.geom_pos - model.body_ipos[model.geom_bodyid], axis=1)
    np.maximum.at(radii, model.geom_bodyid, (away + model.geom_rbound) * (1.0 + 1e-9) + 1e-9)
    return radii


def _runs(numbers: NDArray[np.int32], alone: set[int]) -> Iterator[tuple[int, int, int]]:
    """Yields which body shall have which geoms: its id, its first geom and how many.

    The geoms of a model are in the order of their bodies. Each body in `alone` keeps its own; those of bodies in a row
    between such are joined.
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
