"""In which directions a lidar casts: a grid of angles in the frame of its site, x forward, y left, z up."""

import numpy as np
from numpy.typing import NDArray

from mjplug_plugins.lidar.settings import Settings

Array = NDArray[np.float64]

_PIECE = 8192
"""Rays turned at a time; for more, numpy may start threads, which on a busy machine wait for each other."""


def azimuths(settings: Settings) -> Array:
    """Returns the angle of each column, shape (columns,), increasing [rad]."""
    return np.linspace(*settings.azimuth_range, settings.columns, endpoint=settings.endpoint)


def elevations(settings: Settings) -> Array:
    """Returns the angle of each row, shape (rows,), increasing [rad]."""
    return np.linspace(*settings.elevation_range, settings.rows)


def directions(settings: Settings) -> Array:
    """Returns the unit vector of each ray, row after row, shape (rows * columns, 3), in the axes of the site."""
    azimuth, elevation = np.meshgrid(azimuths(settings), elevations(settings))
    level = np.cos(elevation)
    return np.stack([np.cos(azimuth) * level, np.sin(azimuth) * level, np.sin(elevation)], axis=-1).reshape(-1, 3)


class Rays:
    """The rays of a lidar in the world.

    Attributes:
        rays: Their directions, row after row, shape (rows * columns, 3).

    Args:
        settings: The lidar.
    """

    def __init__(self, settings: Settings) -> None:
        local = directions(settings)
        self.rays = np.empty_like(local)
        self._pieces = [
            (local[begin : begin + _PIECE], self.rays[begin : begin + _PIECE]) for begin in range(0, len(local), _PIECE)
        ]

    def turn(self, axes: Array) -> None:
        """Brings `rays` into the world.

        Args:
            axes: The axes of the site in the world, one a column, shape (3, 3).
        """
        for local, rays in self._pieces:
            np.matmul(local, axes.T, out=rays)
