"""Finds the pixels of the sky by their depth. MuJoCo draws the sky as an upright cylinder around the camera."""

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

_RADIUS = 0.7
"""Radius and half height of the cylinder, as parts of the distance of the far plane."""

_MARGIN = 0.998
"""An object beyond this part of the distance to the cylinder counts as sky."""


class Sky:
    """Computes the depth of the sky in each pixel.

    Args:
        slices: Number of sides of the prism that approximates the cylinder.
    """

    def __init__(self, slices: int) -> None:
        self._nearest = _RADIUS * math.cos(math.pi / max(slices, 3)) * _MARGIN
        self._rays: dict[tuple[object, ...], tuple[NDArray[np.float32], ...]] = {}

    def erase(self, camera: mujoco.MjvGLCamera, depth: NDArray[np.float32]) -> None:
        """Sets the depth of the sky to 0, in place; `depth` is the same as for `mask`."""
        near, far = float(camera.frustum_near), float(camera.frustum_far)
        _, _, length = self._pixel_rays(camera, depth.shape)
        closest = (math.sqrt(length.max()) / self._nearest - 1.0) * near / (far - near)
        rows = np.flatnonzero(depth.min(axis=1) <= closest)
        if len(rows):
            where = slice(rows[0], rows[-1] + 1)
            np.copyto(depth[where], 0.0, where=self.mask(camera, depth, where))

    def mask(
        self, camera: mujoco.MjvGLCamera, depth: NDArray[np.float32], rows: slice = slice(None)
    ) -> NDArray[np.bool_]:
        """Returns which pixels show the sky or no object, shape (number of rows, columns).

        Args:
            camera: The camera of the rendering; it must be a perspective camera.
            depth: Raw depths, 1 at the near plane and 0 at the far plane, bottom row first, shape (rows, columns).
            rows: The rows to test.
        """
        near, far = float(camera.frustum_near), float(camera.frustum_far)
        right, up, length = self._pixel_rays(camera, depth.shape)
        depth, up, length = depth[rows], up[rows], length[rows]
        ahead, above = np.asarray(camera.forward, float), np.asarray(camera.up, float)
        # Vertical rise of each pixel's ray per metre along the optical axis.
        rise = right * np.float32(np.cross(ahead, above)[2]) + (up * np.float32(above[2]) + np.float32(ahead[2]))
        rise *= rise
        # Inverse depth, scaled so that a ray hits the top of the prism at its rise, and a side at its length.
        inverse_depth = depth * np.float32((1.0 / near - 1.0 / far) * self._nearest * far)
        inverse_depth += np.float32(self._nearest)
        inverse_depth *= inverse_depth
        is_sky: NDArray[np.bool_] = inverse_depth <= rise
        inverse_depth += rise
        is_sky |= inverse_depth <= length
        return is_sky

    def _pixel_rays(self, camera: mujoco.MjvGLCamera, shape: tuple[int, ...]) -> tuple[NDArray[np.float32], ...]:
        """Returns the pixels' rays per unit of depth: right (columns,), up (rows, 1), length² (rows, columns)."""
        near, bottom, top = float(camera.frustum_near), float(camera.frustum_bottom), float(camera.frustum_top)
        rows, columns = shape
        half = float(camera.frustum_width) or (top - bottom) * columns / rows / 2
        key = rows, columns, near, bottom, top, half, float(camera.frustum_center)
        if key not in self._rays:
            right = (camera.frustum_center + half * (2 * (np.arange(columns) + 0.5) / columns - 1)) / near
            up = ((bottom + (top - bottom) * (np.arange(rows) + 0.5) / rows) / near)[:, np.newaxis]
            length = right**2 + up**2 + 1.0
            self._rays[key] = right.astype(np.float32), up.astype(np.float32), length.astype(np.float32)
        return self._rays[key]
