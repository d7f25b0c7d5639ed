"""Writes distances into prepared messages."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mjplug.plugin import CdrFrame
from mjplug_plugins.lidar.pattern import azimuths, directions
from mjplug_plugins.lidar.settings import Settings
from mjplug_schemas.sensor_msgs import LaserScan, PointCloud2, PointField
from mjplug_schemas.std_msgs import Header

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_FLOAT_SIZE = 4
"""Size of one coordinate of a point [bytes]."""


class Frame(Protocol):
    """The message of one lidar.

    Attributes:
        message: The message with all constant fields filled in.
    """

    message: CdrFrame

    def write(self, distances: Array, too_close: Mask, no_return: Mask) -> None:
        """Writes the measurements of one scan.

        Args:
            distances: Distance of each ray, row after row, shape (n,) [m].
            too_close: Whether the distance is below the range of the lidar, shape (n,).
            no_return: Whether the ray has no return (too far, or dropped out), shape (n,).
        """


def frame_of(settings: Settings) -> Frame:
    """Returns the message of a lidar: a LaserScan for one row, a PointCloud2 for several rows."""
    return CloudFrame(settings) if settings.rows > 1 else ScanFrame(settings)


class ScanFrame:
    """A `sensor_msgs/LaserScan` for a lidar with one row."""

    def __init__(self, settings: Settings) -> None:
        angles = azimuths(settings)
        low, high = settings.azimuth_range
        self._no_return, self._too_close = (
            (np.inf, -np.inf) if settings.no_return is None else (settings.no_return, settings.no_return)
        )
        self.message = CdrFrame(
            LaserScan(
                header=Header(frame_id=settings.frame_name),
                angle_min=angles[0],
                angle_max=angles[-1],
                # One column has no increment, but readers may divide by angle_increment, so it must not be zero.
                angle_increment=angles[1] - angles[0] if len(angles) > 1 else high - low,
                scan_time=1.0 / settings.update_rate if settings.update_rate else 0.0,
                range_min=settings.min_range,
                range_max=settings.max_range,
                ranges=[0.0] * len(angles),
            )
        )
        self._ranges = self.message.view("ranges")

    def write(self, distances: Array, too_close: Mask, no_return: Mask) -> None:
        """Writes the ranges."""
        self._ranges[:] = distances
        np.putmask(self._ranges, too_close, self._too_close)
        np.putmask(self._ranges, no_return, self._no_return)


class CloudFrame:
    """A `sensor_msgs/PointCloud2` with x, y, z [m] in the order of the rays; a ray without a distance is NaN."""

    def __init__(self, settings: Settings) -> None:
        columns, rows = settings.columns, settings.rows
        step = 3 * _FLOAT_SIZE
        fields = [
            PointField(name=axis, offset=i * _FLOAT_SIZE, datatype=PointField.FLOAT32, count=1)
            for i, axis in enumerate("xyz")
        ]
        self.message = CdrFrame(
            PointCloud2(
                header=Header(frame_id=settings.frame_name),
                height=rows,
                width=columns,
                fields=fields,
                point_step=step,
                row_step=step * columns,
                data=bytes(step * columns * rows),
                is_dense=False,
            )
        )
        self._points = self.message.view("data").view("<f4").reshape(-1, 3)
        # One array for each axis, because numpy is fastest along rows.
        self._directions = np.ascontiguousarray(directions(settings).T, np.float32)
        self._distances = np.empty(columns * rows, np.float32)

    def write(self, distances: Array, too_close: Mask, no_return: Mask) -> None:
        """Writes the points."""
        self._distances[:] = distances
        np.putmask(self._distances, too_close | no_return, np.nan)
        for axis, direction in enumerate(self._directions):
            np.multiply(direction, self._distances, out=self._points[:, axis])
