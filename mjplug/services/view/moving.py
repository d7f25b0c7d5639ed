"""Which bodies of a model can move; the poses of the others are in the drawing pack once."""

import mujoco
import numpy as np
from numpy.typing import NDArray


def moving_bodies(model: mujoco.MjModel) -> NDArray[np.int32]:
    """Returns the ids of the bodies that can move, in ascending order, shape (n,).

    A body can move if it or an ancestor has a joint or is a mocap body.
    """
    moves = (model.body_jntnum > 0) | (model.body_mocapid >= 0)
    # Parents come before their children.
    for body, parent in enumerate(model.body_parentid):
        moves[body] |= moves[parent]
    return np.flatnonzero(moves).astype(np.int32)
