"""One state of the world as numbers that another process can take up."""

import mujoco
import numpy as np
from numpy.typing import NDArray

_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)


def size(model: mujoco.MjModel) -> int:
    """Returns how many numbers a snapshot has."""
    return int(mujoco.mj_stateSize(model, _STATE))


def take(model: mujoco.MjModel, data: mujoco.MjData, out: NDArray[np.float64]) -> None:
    """Writes the state into `out`, of shape (size(model),); costs below a microsecond."""
    mujoco.mj_getState(model, data, out, _STATE)


def load(model: mujoco.MjModel, data: mujoco.MjData, state: NDArray[np.float64]) -> None:
    """Gives `data` a state, of shape (size(model),), and the poses that follow from it; no collisions, no forces."""
    mujoco.mj_setState(model, data, state, _STATE)
    # The rest is what MuJoCo's mj_fwdKinematics does; releases before 3.17 lack it.
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_camlight(model, data)
    mujoco.mj_flex(model, data)
    mujoco.mj_tendon(model, data)
