"""Copies the state of one model to a changed one, element by element."""

from collections.abc import Iterator, Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

Ids = NDArray[np.int64]

_QPOS_SIZE = {
    int(mujoco.mjtJoint.mjJNT_FREE): (7, 6),
    int(mujoco.mjtJoint.mjJNT_BALL): (4, 3),
    int(mujoco.mjtJoint.mjJNT_SLIDE): (1, 1),
    int(mujoco.mjtJoint.mjJNT_HINGE): (1, 1),
}


class Transfer:
    """The places of the state of one model in that of another.

    The places are found in advance, so that a copy takes microseconds.

    Args:
        old: The model that the state belongs to.
        new: The changed model.
        maps: For each kind of element, the new id of each old one; -1 if it is gone.
    """

    def __init__(self, old: mujoco.MjModel, new: mujoco.MjModel, maps: Mapping[str, Ids]) -> None:
        positions, velocities = _joints(old, new, maps["joint"])
        self.positions = _pairs(positions)
        self.velocities = _pairs(velocities)
        self._copies = [
            ("qpos", self.positions),
            *((name, self.velocities) for name in ("qvel", "qacc_warmstart", "qfrc_applied")),
            ("ctrl", _alive(maps["actuator"])),
            ("act", _pairs(_activations(old, new, maps["actuator"]))),
            ("xfrc_applied", _alive(maps["body"])),
            ("eq_active", _alive(maps["equality"])),
        ]
        mocap = _pairs(_mocap(old, new, maps["body"]))
        self._copies += [("mocap_pos", mocap), ("mocap_quat", mocap)]
        shared = min(old.nuserdata, new.nuserdata)
        self._copies.append(("userdata", (np.arange(shared), np.arange(shared))))
        if getattr(old, "nhistory", 0):
            self._copies.append(("history", _pairs(_histories(old, new, maps))))
        self._copies = [(name, places) for name, places in self._copies if len(places[0])]

    def copy(self, old: mujoco.MjData, new: mujoco.MjData) -> None:
        """Copies the state and the time; derived quantities are out of date afterwards."""
        for name, (source, target) in self._copies:
            getattr(new, name)[target] = getattr(old, name)[source]
        new.time = old.time


def _pairs(pairs: Iterator[tuple[int, int]]) -> tuple[Ids, Ids]:
    found = np.array(list(pairs), np.int64).reshape(-1, 2)
    return found[:, 0], found[:, 1]


def _alive(ids: Ids) -> tuple[Ids, Ids]:
    old = np.flatnonzero(ids >= 0)
    return old, ids[old]


def _joints(
    old: mujoco.MjModel, new: mujoco.MjModel, ids: Ids
) -> tuple[Iterator[tuple[int, int]], Iterator[tuple[int, int]]]:
    def places(address: str, part: int) -> Iterator[tuple[int, int]]:
        for before, after in enumerate(ids.tolist()):
            if after >= 0:
                begin, end = getattr(old, address)[before], getattr(new, address)[after]
                for i in range(_QPOS_SIZE[int(old.jnt_type[before])][part]):
                    yield int(begin) + i, int(end) + i

    return places("jnt_qposadr", 0), places("jnt_dofadr", 1)


def _activations(old: mujoco.MjModel, new: mujoco.MjModel, ids: Ids) -> Iterator[tuple[int, int]]:
    for before, after in enumerate(ids.tolist()):
        if after >= 0:
            for i in range(int(old.actuator_actnum[before])):
                yield int(old.actuator_actadr[before]) + i, int(new.actuator_actadr[after]) + i


def _mocap(old: mujoco.MjModel, new: mujoco.MjModel, ids: Ids) -> Iterator[tuple[int, int]]:
    for before, after in enumerate(ids.tolist()):
        if after >= 0 and old.body_mocapid[before] >= 0:
            yield int(old.body_mocapid[before]), int(new.body_mocapid[after])


def _histories(old: mujoco.MjModel, new: mujoco.MjModel, maps: Mapping[str, Ids]) -> Iterator[tuple[int, int]]:
    """Yields the places of the buffers of delayed actuators and sensors."""
    starts = [
        int(begin)
        for kind in ("actuator", "sensor")
        for count, begin in zip(getattr(old, f"{kind}_history")[:, 0], getattr(old, f"{kind}_historyadr"), strict=True)
        if count > 0
    ]
    starts.sort()
    ends = dict(zip(starts, [*starts[1:], int(old.nhistory)], strict=True))
    for kind in ("actuator", "sensor"):
        addresses, after = getattr(old, f"{kind}_historyadr").tolist(), getattr(new, f"{kind}_historyadr").tolist()
        for before, number in enumerate(maps[kind].tolist()):
            begin = addresses[before]
            if number >= 0 and begin in ends:
                for i in range(ends[begin] - begin):
                    yield begin + i, after[number] + i
