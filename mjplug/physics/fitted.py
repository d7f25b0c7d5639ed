"""A model with its state, and everything that is derived from both and stays the same during the steps."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.near_names import Names
from mjplug.physics import physics_state
from mjplug.physics.checkpoint import Checkpoint
from mjplug.physics.memory import ZeroedArrays, float_view

_BODY, _JOINT, _KEY = mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_JOINT, mujoco.mjtObj.mjOBJ_KEY


class Fitted:
    """A model with its state. It is made in any thread, and then used by the physics thread.

    Attributes:
        model: The compiled model; its flag mjDSBL_AUTORESET is set.
        data: The state.
        known: The names of bodies, joints and keyframes, for error messages.
        keyframes: The name of each keyframe, or its index if it is unnamed.
        checkpoint: The state to which the simulation returns after a divergence.
        forces: `xfrc_applied` and `qfrc_applied`.
        free_joints: Joint id of the free joint by body id, in joint order.
        free_bodies: Names of the bodies with a free joint.
        warnings: MuJoCo's counters of warnings.
        qvel: View of the velocities.

    Args:
        model: As above.
        data: As above.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        self.model, self.data = model, data
        names = (mujoco.mj_id2name(model, _KEY, index) for index in range(model.nkey))
        self.keyframes = [name or str(index) for index, name in enumerate(names)]
        # Built in advance, so that a request with a wrong name takes little time on the physics thread.
        self.known = {
            _BODY: Names(_names(model, _BODY, model.nbody)),
            _JOINT: Names(_names(model, _JOINT, model.njnt)),
            _KEY: Names(self.keyframes),
        }
        self.checkpoint = Checkpoint(model, data)
        self.forces = ZeroedArrays((data.xfrc_applied, data.qfrc_applied))
        free = np.flatnonzero(model.jnt_type == int(mujoco.mjtJoint.mjJNT_FREE))
        self.free_joints = dict(zip(model.jnt_bodyid[free].tolist(), free.tolist(), strict=True))
        self.free_bodies = Names(mujoco.mj_id2name(model, _BODY, body) or "" for body in self.free_joints)
        self.warnings = data.warning.number.data
        self.qvel = float_view(data.qvel)
        self._results: dict[str, NDArray[np.float64]] | None = None

    @property
    def results(self) -> dict[str, NDArray[np.float64]]:
        """The arrays that `physics_state.result_arrays` returns; found at the first use."""
        if self._results is None:
            self._results = physics_state.result_arrays(self.data)
        return self._results


def _names(model: mujoco.MjModel, kind: mujoco.mjtObj, count: int) -> list[str]:
    names = (mujoco.mj_id2name(model, kind, i) for i in range(count))
    return [name for name in names if name]
