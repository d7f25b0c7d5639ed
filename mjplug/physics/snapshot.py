"""Copies of the simulation state (mjSTATE_INTEGRATION) that another process can load."""

import mujoco
import numpy as np
from numpy.typing import NDArray

_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)


def size(model: mujoco.MjModel) -> int:
    """Returns the number of float64 values in a snapshot."""
    return int(mujoco.mj_stateSize(model, _STATE))


def take(model: mujoco.MjModel, data: mujoco.MjData, out: NDArray[np.float64]) -> None:
    """Writes the state to `out`, shape (size(model),); takes less than a microsecond."""
    mujoco.mj_getState(model, data, out, _STATE)


def load(model: mujoco.MjModel, data: mujoco.MjData, state: NDArray[np.float64]) -> None:
    """Sets the state of `data` and computes the poses that follow from it, but neither contacts nor forces.

    Args:
        model: The model.
        data: Gets the state.
        state: A snapshot, shape (size(model),).
    """
    mujoco.mj_setState(model, data, state, _STATE)
    # Same as mj_fwdKinematics, which MuJoCo before 3.17 lacks.
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_camlight(model, data)
    mujoco.mj_flex(model, data)
    mujoco.mj_tendon(model, data)
