"""Sleeping bodies: what MuJoCo keeps about them outside its state vectors. Physics thread only.

MuJoCo skips a sleeping body: the results of the last step before it fell asleep stay in mjData, and a body whose pose
does not equal its positions, bit by bit, is woken.
"""

from collections.abc import Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_FEW_STEPS = 5.5
"""No body sleeps again within this many steps after it was woken; MuJoCo's minimum is 10 (mjMINAWAKE)."""

_LONGEST_COUNTDOWN = 1000
"""MuJoCo counts down from a few steps before a tree sleeps; a larger number in `tree_asleep` is an error."""


def sleeps(model: mujoco.MjModel) -> bool:
    """Returns whether bodies of the model may sleep."""
    return bool(model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_SLEEP) and hasattr(mujoco.MjData, "tree_asleep")


def is_valid(asleep: NDArray[np.int32]) -> bool:
    """Returns whether MuJoCo can read `tree_asleep` safely.

    Each element is a negative countdown, or the next tree in a closed chain of sleeping trees.
    """
    sleeping = np.flatnonzero(asleep >= 0)
    closed = np.array_equal(np.sort(asleep[sleeping]), sleeping)
    return bool(closed and (asleep > -_LONGEST_COUNTDOWN).all())


def derive_awake(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Sets what MuJoCo derives from `tree_asleep`; its function for it (mj_updateSleep) is not in its API.

    The next step compares the two, and would wake all bodies.
    """
    static, asleep, awake = (
        int(getattr(mujoco.mjtSleepState, name)) for name in ("mjS_STATIC", "mjS_ASLEEP", "mjS_AWAKE")
    )
    tree_awake = data.tree_asleep < 0
    data.tree_awake[:] = tree_awake
    data.ntree_awake = int(tree_awake.sum())
    moving, mocap = model.body_treeid >= 0, model.body_mocapid[model.body_rootid] >= 0
    body_awake = np.where(mocap, awake, static)
    body_awake[moving] = np.where(tree_awake[model.body_treeid[moving]], awake, asleep)
    data.body_awake[:] = body_awake
    bodies = np.flatnonzero(body_awake != asleep)
    # The world has no parent.
    children = 1 + np.flatnonzero(body_awake[model.body_parentid[1:]] != asleep)
    dofs = np.flatnonzero(moving[model.dof_bodyid] & (body_awake[model.dof_bodyid] == awake))
    data.nbody_awake, data.nparent_awake, data.nv_awake = len(bodies), len(children), len(dofs)
    data.body_awake_ind[: len(bodies)] = bodies
    data.parent_awake_ind[: len(children)] = children
    data.dof_awake_ind[: len(dofs)] = dofs


class SleepingResults:
    """The results of the last step of sleeping bodies, such as their poses, for the return to an earlier state.

    They do not change while bodies sleep, so they are copied only when others sleep than before, or elsewhere.

    Args:
        model: The model.
        data: The state.
        results: The arrays that `physics_state.result_arrays` returns for `data`.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, results: Mapping[str, Array]) -> None:
        self._data = data
        self._results = results
        self._tree_asleep = data.tree_asleep
        self._seen = b""
        self._time = data.time
        self._short = _FEW_STEPS * model.opt.timestep
        sizes = np.diff(np.append(model.jnt_qposadr, model.nq))
        self._trees = np.repeat(model.body_treeid[model.jnt_bodyid], sizes)
        self._asleep = np.zeros(model.nq, np.bool_)
        self._positions = np.empty(0)
        self._copies: dict[str, Array] = {}

    def save(self) -> None:
        """Copies the results if other bodies sleep than at the last call, or at other positions."""
        before, self._time = self._time, self._data.time
        seen = self._tree_asleep.tobytes()
        if seen != self._seen:
            self._seen = seen
            asleep = (self._tree_asleep >= 0)[self._trees]
            if not np.array_equal(asleep, self._asleep):
                self._asleep = asleep
                self._copy()
                return
        # They may have been woken and fallen asleep again, which takes several steps.
        if not self._copies or abs(self._time - before) < self._short:
            return
        if not np.array_equal(self._data.qpos[self._asleep], self._positions):
            self._copy()

    def restore(self) -> None:
        """Sets the results of all bodies, if one slept; only those of sleeping bodies are those at the last `save`."""
        for name, array in self._copies.items():
            self._results[name][...] = array

    def _copy(self) -> None:
        self._positions = self._data.qpos[self._asleep]
        self._copies = {name: array.copy() for name, array in self._results.items()} if self._positions.size else {}
