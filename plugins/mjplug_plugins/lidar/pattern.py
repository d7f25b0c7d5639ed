"""Directions of a lidar's rays: a grid of angles in the frame of its site, x forward, y left, z up."""

import numpy as np
from numpy.typing import NDArray

from mjplug_plugins.lidar.settings import Settings

Array = NDArray[np.float64]

_CHUNK_SIZE = 8192
"""Rays rotated at a time; for more, numpy may start threads, which wait for each other on a busy machine."""


def azimuths(settings: Settings) -> Array:
    """Returns the angle of each column, shape (columns,), increasing [rad]."""
    return np.linspace(*settings.azimuth_range, settings.columns, endpoint=settings.endpoint)


def elevations(settings: Settings) -> Array:
    """Returns the angle of each row, shape (rows,), increasing [rad]."""
    return np.linspace(*settings.elevation_range, settings.rows)


def directions(settings: Settings) -> Array:
    """Returns the unit vector of each ray in the site frame, row after row, shape (rows * columns, 3)."""
    azimuth, elevation = np.meshgrid(azimuths(settings), elevations(settings))
    level = np.cos(elevation)
    return np.stack([np.cos(azimuth) * level, np.sin(azimuth) * level, np.sin(elevation)], axis=-1).reshape(-1, 3)


class Rays:
    """The directions of a lidar's rays in the world frame.

    Attributes:
        rays: Unit vectors in the world frame, row after row, shape (rows * columns, 3).

    Args:
        settings: Settings of the lidar.
    """

    def __init__(self, settings: Settings) -> None:
        local = directions(settings)
        self.rays = np.empty_like(local)
        self._chunks = [
            (local[begin : begin + _CHUNK_SIZE], self.rays[begin : begin + _CHUNK_SIZE])
            for begin in range(0, len(local), _CHUNK_SIZE)
        ]

    def rotate(self, axes: Array) -> None:
        """Rotates the directions from the site frame to the world frame and writes them to `rays`.

        Args:
            axes: Rotation matrix of the site in the world frame, shape (3, 3).
        """
        for local, rays in self._chunks:
            np.matmul(local, axes.T, out=rays)
