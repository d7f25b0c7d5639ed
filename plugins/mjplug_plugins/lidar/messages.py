"""Distances as messages, in frames that are kept ready."""

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

_FLOAT = 4
"""Length of a number in a point [bytes]."""


class Frame(Protocol):
    """A message of one lidar.

    Attributes:
        message: The message, kept ready.
    """

    message: CdrFrame

    def write(self, distances: Array, too_close: Mask, nothing: Mask) -> None:
        """Writes what was measured.

        Args:
            distances: Shape (n,), row after row [m].
            too_close: Which of them are shorter than can be measured, shape (n,).
            nothing: Which of them are none: too far, or no answer, shape (n,).
        """


def frame_of(settings: Settings) -> Frame:
    """Returns the message of a lidar: a scan for one row, a cloud for several."""
    return CloudFrame(settings) if settings.rows > 1 else ScanFrame(settings)


class ScanFrame:
    """A `sensor_msgs/LaserScan`, for one row."""

    def __init__(self, settings: Settings) -> None:
        angles = azimuths(settings)
        low, high = settings.azimuth_range
        self._nothing, self._too_close = (
            (np.inf, -np.inf) if settings.no_return is None else (settings.no_return, settings.no_return)
        )
        self.message = CdrFrame(
            LaserScan(
                header=Header(frame_id=settings.frame_name),
                angle_min=angles[0],
                angle_max=angles[-1],
                # With one column there is no next one; a zero would have readers divide by it.
                angle_increment=angles[1] - angles[0] if len(angles) > 1 else high - low,
                scan_time=1.0 / settings.update_rate if settings.update_rate else 0.0,
                range_min=settings.min_range,
                range_max=settings.max_range,
                ranges=[0.0] * len(angles),
            )
        )
        self._ranges = self.message.view("ranges")

    def write(self, distances: Array, too_close: Mask, nothing: Mask) -> None:
        """Writes the ranges."""
        self._ranges[:] = distances
        np.putmask(self._ranges, too_close, self._too_close)
        np.putmask(self._ranges, nothing, self._nothing)


class CloudFrame:
    """A `sensor_msgs/PointCloud2` with x, y, z, in the order of the rays; a ray without a distance is NaN."""

    def __init__(self, settings: Settings) -> None:
        columns, rows = settings.columns, settings.rows
        step = 3 * _FLOAT
        fields = [
            PointField(name=axis, offset=i * _FLOAT, datatype=PointField.FLOAT32, count=1)
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
        # One array an axis: numpy is quickest along rows.
        self._directions = np.ascontiguousarray(directions(settings).T, np.float32)
        self._distances = np.empty(columns * rows, np.float32)

    def write(self, distances: Array, too_close: Mask, nothing: Mask) -> None:
        """Writes the points."""
        self._distances[:] = distances
        np.putmask(self._distances, too_close | nothing, np.nan)
        for axis, direction in enumerate(self._directions):
            np.multiply(direction, self._distances, out=self._points[:, axis])
