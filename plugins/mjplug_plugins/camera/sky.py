"""Tells the sky from what stands before it. MuJoCo draws it as an upright cylinder around the camera, with a depth."""

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

_RADIUS = 0.7
"""Radius and half the height of the cylinder, in distances of the far plane."""

_MARGIN = 0.998
"""What stands so close to the sky is taken for it."""


class Sky:
    """Knows at which depth the sky is in each pixel.

    Args:
        slices: Sides of the prism that stands for the cylinder.
    """

    def __init__(self, slices: int) -> None:
        self._nearest = _RADIUS * math.cos(math.pi / max(slices, 3)) * _MARGIN
        self._rays: dict[tuple[object, ...], tuple[NDArray[np.float32], ...]] = {}

    def erase(self, camera: mujoco.MjvGLCamera, depth: NDArray[np.float32]) -> None:
        """Sets the depth of the sky to 0, in place; see `seen`."""
        near, far = float(camera.frustum_near), float(camera.frustum_far)
        _, _, length = self._directions(camera, depth.shape)
        closest = (math.sqrt(length.max()) / self._nearest - 1.0) * near / (far - near)
        rows = np.flatnonzero(depth.min(axis=1) <= closest)
        if len(rows):
            where = slice(rows[0], rows[-1] + 1)
            np.copyto(depth[where], 0.0, where=self.seen(camera, depth, where))

    def seen(
        self, camera: mujoco.MjvGLCamera, depth: NDArray[np.float32], rows: slice = slice(None)
    ) -> NDArray[np.bool_]:
        """Returns in which pixels of some rows the sky is seen, or nothing at all.

        Args:
            camera: As the scene was drawn; in perspective.
            depth: Shape (rows, columns), bottom row first: raw depths, 1 at the near plane and 0 at the far one.
            rows: Which.
        """
        near, far = float(camera.frustum_near), float(camera.frustum_far)
        across, up, length = self._directions(camera, depth.shape)
        depth, up, length = depth[rows], up[rows], length[rows]
        ahead, above = np.asarray(camera.forward, float), np.asarray(camera.up, float)
        # How far the ray of each pixel rises for each metre along the optical axis.
        rise = across * np.float32(np.cross(ahead, above)[2]) + (up * np.float32(above[2]) + np.float32(ahead[2]))
        rise *= rise
        # One over the depth, in units in which the ray meets the lid of the prism at its rise, and a side at its reach.
        closeness = depth * np.float32((1.0 / near - 1.0 / far) * self._nearest * far)
        closeness += np.float32(self._nearest)
        closeness *= closeness
        met: NDArray[np.bool_] = closeness <= rise
        closeness += rise
        met |= closeness <= length
        return met

    def _directions(self, camera: mujoco.MjvGLCamera, shape: tuple[int, ...]) -> tuple[NDArray[np.float32], ...]:
        """Returns the rays of the pixels: to the right (columns), up (rows, 1), and their squared length, in depths."""
        near, bottom, top = float(camera.frustum_near), float(camera.frustum_bottom), float(camera.frustum_top)
        rows, columns = shape
        half = float(camera.frustum_width) or (top - bottom) * columns / rows / 2
        key = rows, columns, near, bottom, top, half, float(camera.frustum_center)
        if key not in self._rays:
            across = (camera.frustum_center + half * (2 * (np.arange(columns) + 0.5) / columns - 1)) / near
            up = ((bottom + (top - bottom) * (np.arange(rows) + 0.5) / rows) / near)[:, np.newaxis]
            length = across**2 + up**2 + 1.0
            self._rays[key] = across.astype(np.float32), up.astype(np.float32), length.astype(np.float32)
        return self._rays[key]
