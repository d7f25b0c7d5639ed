"""Computes the poses of all frames relative to their parents at once."""

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug_plugins.transforms.frame import OPTICAL_QUAT, compose
from mjplug_plugins.transforms.tree import Link

Array = NDArray[np.float64]

_INVERSE_PRODUCT = np.array(((0, 1, 2, 3), (1, 0, 3, 2), (2, 3, 0, 1), (3, 2, 1, 0)))
_INVERSE_SIGNS = np.array(((1, 1, 1, 1), (-1, 1, 1, -1), (-1, -1, 1, 1), (-1, 1, -1, 1)), np.float64)
"""Indices and signs of the 4x4 matrix that multiplies by the inverse of a unit quaternion (w, x, y, z) from left."""


class Relative:
    """The poses of frames relative to their parents.

    Attributes:
        poses: Position [m] and quaternion (w, x, y, z) of each link, in the parent frame, shape (n, 7).

    Args:
        model: The compiled model.
        data: The state.
        links: The links.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, links: Sequence[Link]) -> None:
        self._model, self._data = model, data
        self._cameras = [(i, link.frame.camera) for i, link in enumerate(links) if link.frame.camera is not None]
        self._children = np.array([link.frame.body for link in links], np.intp)
        self._parents = np.array([link.parent for link in links], np.intp)
        self._pos = np.array([link.frame.pos for link in links]).reshape(-1, 3)
        self._quat = np.array([link.frame.quat_wxyz for link in links]).reshape(-1, 4, 1)
        self._matrices = data.xmat.reshape(-1, 3, 3)
        self._shifted = bool(self._pos.any())
        self._turned = bool((self._quat[:, 1:] != 0.0).any())
        self.poses = np.empty((len(links), 7))

    def update(self) -> None:
        """Computes `poses` from the body poses in the state, which must be current."""
        data, children, parents = self._data, self._children, self._parents
        shift = data.xpos.take(children, 0)
        if self._shifted:
            shift += (self._matrices.take(children, 0) @ self._pos[:, :, None])[:, :, 0]
        shift -= data.xpos.take(parents, 0)
        # A row vector times a matrix equals the transposed matrix times the vector.
        np.matmul(shift[:, None, :], self._matrices.take(parents, 0), self.poses[:, None, :3])
        turns = _inverse_matrices(data.xquat.take(parents, 0)) @ data.xquat.take(children, 0)[:, :, None]
        self.poses[:, 3:] = turns[:, :, 0]
        if self._turned:
            for turn, local, pose in zip(turns, self._quat, self.poses, strict=True):
                pose[3:] = compose(turn[:, 0], local[:, 0])
        if self._cameras:
            self._update_cameras()

    def _update_cameras(self) -> None:
        """Computes the poses of cameras that track or target something; the parent of their frames is the world."""
        model, data = self._model, self._data
        mujoco.mj_comPos(model, data)
        mujoco.mj_camlight(model, data)
        quat, shift = np.empty(4), np.empty(3)
        for i, camera in self._cameras:
            mujoco.mju_mat2Quat(quat, data.cam_xmat[camera])
            optical = compose(quat, OPTICAL_QUAT)
            mujoco.mju_rotVecQuat(shift, self._pos[i], optical)
            self.poses[i, :3] = data.cam_xpos[camera] + shift
            self.poses[i, 3:] = compose(optical, self._quat[i, :, 0])


def _inverse_matrices(quat_wxyz: Array) -> Array:
    """Returns, for n unit quaternions, shape (n, 4), the matrices that multiply by their inverses, shape (n, 4, 4)."""
    return quat_wxyz[:, _INVERSE_PRODUCT] * _INVERSE_SIGNS
