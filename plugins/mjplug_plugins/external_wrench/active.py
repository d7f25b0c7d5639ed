"""The active wrenches, and their sum at each step."""

from collections.abc import Iterable, Iterator, Mapping, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug_plugins.external_wrench.wrench import Wrench

NEVER = 1 << 62
"""A step number that is never reached."""

MAX_LOOPED = 16
"""Up to this number of wrenches, a loop over them is faster than numpy."""


class ActiveWrenches:
    """The active wrenches in the order of their start, each with the id of its markers.

    Attributes:
        next_end: The first step at which a wrench ends; `NEVER` if there is none.
        looped: All wrenches if there are at most `MAX_LOOPED`, to apply one by one; else empty, and `apply` adds them.

    Args:
        model: The compiled model.
        data: The state that the wrenches act on.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self.next_end = NEVER
        self.looped: tuple[Wrench, ...] = ()
        self._timestep = float(model.opt.timestep)
        self._data = data
        self._ids: dict[Wrench, int] = {}
        self._next_id = 0
        self._table: _Table | None = None

    def __len__(self) -> int:
        return len(self._ids)

    def __iter__(self) -> Iterator[tuple[Wrench, int]]:
        return iter(self._ids.items())

    def add(self, wrenches: Sequence[Wrench]) -> None:
        """Adds wrenches; they must not be active yet."""
        ids = range(self._next_id, self._next_id + len(wrenches))
        self._next_id = ids.stop
        self._ids.update(zip(wrenches, ids, strict=True))
        self._changed()
        if self._table is not None:
            self._table.add(wrenches, ids)

    def remove(self, wrenches: Iterable[Wrench]) -> None:
        """Removes wrenches; inactive ones are ignored."""
        removed = [self._ids.pop(wrench) for wrench in wrenches if wrench in self._ids]
        self._changed()
        if len(self._ids) <= MAX_LOOPED:
            self._table = None
        elif self._table is not None and removed:
            self._table.remove(removed)

    def ended(self, step: int) -> list[Wrench]:
        """Returns the wrenches that end at `step` or before."""
        return [wrench for wrench in self._ids if wrench.end <= step]

    @property
    def next_id(self) -> int:
        """The id of the next wrench."""
        return self._next_id

    def replace(self, wrenches: Mapping[Wrench, int], next_id: int) -> None:
        """Replaces all wrenches by others with their ids."""
        self._ids = dict(wrenches)
        self._next_id = next_id
        self._table = None
        self._changed()

    def _changed(self) -> None:
        self.looped = tuple(self._ids) if len(self._ids) <= MAX_LOOPED else ()
        self.next_end = min((wrench.end for wrench in self._ids), default=NEVER)

    def apply(self, step: int) -> None:
        """Adds the sum of the wrenches to `xfrc_applied` at step `step`; `xmat` must be current."""
        if self._table is None:
            self._table = _Table(self._data, self._timestep)
            self._table.add(list(self._ids), list(self._ids.values()))
        self._table.apply(step)


class _Table:
    """The wrenches as columns of arrays. The sums are identical to those of `Wrench.apply`, bit by bit."""

    def __init__(self, data: mujoco.MjData, timestep: float) -> None:
        self._xmat = data.xmat
        self._xfrc_applied = data.xfrc_applied.reshape(-1)
        self._timestep = timestep
        # Rows: id, body, start [step].
        self._whole = np.empty((3, 0), np.int64)
        # Rows: force [N], torque about the centre of mass [N m], duration [s], ramp [s].
        self._real = np.empty((8, 0))

    def add(self, wrenches: Sequence[Wrench], ids: Iterable[int]) -> None:
        whole = [(marker_id, w.body, w.start) for w, marker_id in zip(wrenches, ids, strict=True)]
        real = [(*w.force, *w.torque_com, w.duration, w.ramp) for w in wrenches]
        self._set(
            np.concatenate((self._whole, np.array(whole, np.int64).T), axis=1),
            np.concatenate((self._real, np.array(real, np.float64).T), axis=1),
        )

    def remove(self, ids: Sequence[int]) -> None:
        keep = ~np.isin(self._whole[0], ids)
        self._set(self._whole[:, keep], self._real[:, keep])

    def apply(self, step: int) -> None:
        # The order of the operations is the same as in `Wrench.apply`.
        rotation = np.ascontiguousarray(self._xmat.take(self._bodies, axis=0).T).reshape(3, 3, -1)
        x, y, z = rotation[:, 0], rotation[:, 1], rotation[:, 2]
        fx, fy, fz, tx, ty, tz = self._wrenches
        wrenches = np.concatenate((x * fx + y * fy + z * fz, x * tx + y * ty + z * tz))
        if self._ramped is not None:
            wrenches *= self._scale(step)
        # `add.at` adds every wrench on a body, in order; `+=` would add only one of them.
        np.add.at(self._xfrc_applied, self._targets, wrenches.reshape(-1))

    def _set(self, whole: NDArray[np.int64], real: NDArray[np.float64]) -> None:
        self._whole, self._real = whole, real
        self._bodies = whole[1]
        self._wrenches, self._durations, self._ramps = real[:6], real[6], real[7]
        ramped = self._ramps > 0
        self._ramped = ramped if ramped.any() else None
        self._targets = (6 * self._bodies + np.arange(6)[:, None]).reshape(-1)

    def _scale(self, step: int) -> NDArray[np.float64]:
        remaining = self._durations - (step - self._whole[2]) * self._timestep
        scale = np.ones(remaining.shape)
        np.divide(remaining, self._ramps, out=scale, where=self._ramped)
        return np.clip(scale, 0.0, 1.0, out=scale)
