"""Publishes groups of MuJoCo's rangefinder sensors as laser scans; for models that were made for this."""

import math
import re
from collections.abc import Iterator
from itertools import islice
from typing import Annotated

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, ValidationInfo, field_validator

from mjplug.plugin import CdrFrame, Host, NestedParameters, Parameters, Plugin, PluginError, Publisher, UnknownName
from mjplug_schemas.sensor_msgs import LaserScan
from mjplug_schemas.std_msgs import Header

_RANGEFINDER = int(mujoco.mjtSensor.mjSENS_RANGEFINDER)
_SITE = int(mujoco.mjtObj.mjOBJ_SITE)
_RAY_NAME = re.compile(r"(.+)-(\d+)", re.ASCII)

_TOLERANCE = 1e-3
"""A last ray that misses `max_angle` by less is still meant; angles in files are rounded [increments]."""

_MOST_NAMES = 20


class LidarParameters(Parameters):
    """Parameters of one lidar, under its name."""

    frame_name: str = Field(description="Frame of the scan.")
    min_angle: float = Field(description="Angle of ray 0 [rad].")
    max_angle: float = Field(description="Angle up to which there are rays [rad].")
    angle_increment: float = Field(description="Angle from one ray to the next [rad].")
    range_min: float = Field(default=0.0, ge=0, description="Shortest distance that can be measured [m].")
    range_max: float = Field(
        default=1000.0, gt=0, validate_default=True, description="Longest distance that can be measured [m]."
    )
    laserscan_topic: str = Field(default="{ns}/scan", description="Topic name.")

    @property
    def rays(self) -> int:
        """The number of rays from `min_angle` to `max_angle`, both included."""
        return math.floor(self._increments + _TOLERANCE) + 1

    @property
    def rays_without_rounding(self) -> int:
        """The same, without allowing for the rounding of floats: how models were made that have one ray too few."""
        return int(self._increments) + 1

    @property
    def _increments(self) -> float:
        return (self.max_angle - self.min_angle) / self.angle_increment

    @field_validator("angle_increment")
    @classmethod
    def _leads_to_max_angle(cls, increment: float, info: ValidationInfo) -> float:
        if not increment:
            raise ValueError("Input should not be 0")
        if {"min_angle", "max_angle"} <= info.data.keys():
            low, high = info.data["min_angle"], info.data["max_angle"]
            if (high - low) / increment < 0:
                raise ValueError(f"{increment:g} does not lead from min_angle = {low:g} to max_angle = {high:g}")
            if not math.isfinite((high - low) / increment):
                raise ValueError(f"{increment:g} is too small for the way from min_angle to max_angle")
        return increment

    @field_validator("range_max")
    @classmethod
    def _above_range_min(cls, range_max: float, info: ValidationInfo) -> float:
        if range_max <= info.data.get("range_min", 0.0):
            raise ValueError(f"{range_max:g} is not above range_min, which is {info.data['range_min']:g}")
        return range_max


class RangefinderLidarParameters(Parameters):
    """Parameters of RangefinderLidar; every other name is that of a lidar, with LidarParameters below it."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Annotated[LidarParameters, NestedParameters]]

    lidar_publish_rate: float = Field(
        default=5.0, gt=0, description="Scans per second of simulated time, of every lidar [Hz]."
    )


class RangefinderLidar(Plugin[RangefinderLidarParameters]):
    """Publishes rangefinder sensors named `<lidar>-0`, `<lidar>-1`, … as one `sensor_msgs/LaserScan`.

    For each lidar, its name with `frame_name`, `min_angle`, `max_angle` and `angle_increment` [rad], and optionally
    `range_min`, `range_max` [m] and `laserscan_topic`. A range is infinite where nothing is in range, and minus
    infinite where something is too close. A scan belongs to the very state of its stamp.
    """

    def init(self, host: Host, parameters: RangefinderLidarParameters) -> None:
        """Finds the rays of each lidar and starts the timers."""
        groups = _groups(host.model)
        configured = parameters.__pydantic_extra__
        if not configured and groups:
            raise PluginError(
                "no lidar is configured; give frame_name, min_angle, max_angle and angle_increment below the name of "
                f"one of: {', '.join(sorted(groups))}"
            )
        if not configured:
            host.logger.warning("the model has no rangefinder named <lidar>-<number>: nothing is published")
        for name, lidar in configured.items():
            if name not in groups:
                raise UnknownName("rangefinder lidar", name, groups)
            sensors = _sensors(host, name, lidar, groups[name])
            publisher = host.create_publisher(LaserScan, lidar.laserscan_topic)
            scan = _Scan(host, publisher, lidar, sensors, 1.0 / parameters.lidar_publish_rate)
            host.create_timer(1.0 / parameters.lidar_publish_rate, scan.publish, while_matched=publisher)
        if left := sorted(groups.keys() - configured.keys()) if configured else []:
            host.logger.warning("without parameters, and so not published: %s", ", ".join(left))


class _Scan:
    """One lidar at work.

    The rays are cast here, as MuJoCo's sensors cast them, because after a step the sensors' own values are one step
    older than the time.
    """

    def __init__(
        self, host: Host, publisher: Publisher[LaserScan], lidar: LidarParameters, sensors: list[int], period: float
    ) -> None:
        model, data = host.model, host.data
        self._host = host
        self._publisher = publisher
        sites = model.sensor_objid[sensors]
        self._rays = [
            (data.site_xpos[s], data.site_xmat[s].reshape(3, 3)[:, 2], int(model.site_bodyid[s])) for s in sites
        ]
        # A sensor says its cutoff for everything beyond it.
        cutoff = model.sensor_cutoff[sensors]
        self._farthest = np.minimum(lidar.range_max, np.where(cutoff > 0, cutoff, np.inf))
        self._nearest = lidar.range_min
        self._geom = np.zeros(1, np.int32)
        self._message = CdrFrame(
            LaserScan(
                header=Header(frame_id=host.frame_id(lidar.frame_name)),
                angle_min=lidar.min_angle,
                angle_max=lidar.min_angle + (len(sensors) - 1) * lidar.angle_increment,
                angle_increment=lidar.angle_increment,
                scan_time=period,
                range_min=lidar.range_min,
                range_max=lidar.range_max,
                ranges=[0.0] * len(sensors),
            )
        )
        self._ranges = self._message.view("ranges")

    def publish(self) -> None:
        """Casts all rays and sends the scan."""
        host = self._host
        host.kinematics()
        distances = np.array([self._cast(*ray) for ray in self._rays])
        nothing = (distances < 0.0) | (distances > self._farthest)
        too_close = (distances < self._nearest) & ~nothing
        self._ranges[:] = np.select([nothing, too_close], [np.inf, -np.inf], distances)
        self._message.set_stamp("header.stamp", host.time_ns)
        self._publisher.publish_frame(self._message)

    def _cast(self, origin: NDArray[np.float64], direction: NDArray[np.float64], body: int) -> float:
        return mujoco.mj_ray(self._host.model, self._host.data, origin, direction, None, True, body, self._geom)


def _groups(model: mujoco.MjModel) -> dict[str, dict[int, int]]:
    """Returns the rangefinders named `<lidar>-<number>`: lidar to number to sensor id."""
    groups: dict[str, dict[int, int]] = {}
    for sensor in range(model.nsensor):
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_SENSOR, sensor) or ""
        if model.sensor_type[sensor] == _RANGEFINDER and (match := _RAY_NAME.fullmatch(name)):
            group = groups.setdefault(match[1], {})
            if (number := int(match[2])) in group:
                other = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_SENSOR, group[number])
                raise PluginError(f"rangefinders {other!r} and {name!r} are both ray {number} of lidar {match[1]!r}")
            group[number] = sensor
    return groups


def _sensors(host: Host, name: str, lidar: LidarParameters, group: dict[int, int]) -> list[int]:
    """Returns the sensor of each ray, in the order of the angles.

    Raises:
        PluginError: A ray is missing, or is no single ray from a site.
    """
    rays = lidar.rays
    missing = rays - sum(number < rays for number in group)
    if missing == 1 and rays - 1 not in group and lidar.rays_without_rounding == rays - 1:
        rays -= 1
        host.logger.warning(
            "lidar %r: the model has no ray %d at max_angle = %g, so the scan ends at %g; whoever made the model "
            "truncated (max_angle - min_angle) / angle_increment",
            name,
            rays,
            lidar.max_angle,
            lidar.min_angle + (rays - 1) * lidar.angle_increment,
        )
    elif missing:
        raise PluginError(
            f"the angles of lidar {name!r} make {rays} rays, but the model has no rangefinder named "
            f"{_listing(name, (i for i in range(rays) if i not in group), missing)}"
        )
    if beyond := [number for number in group if number >= rays]:
        host.logger.warning(
            "lidar %r: %d rays from %s-%d on lie beyond max_angle", name, len(beyond), name, min(beyond)
        )
    sensors = [group[number] for number in range(rays)]
    for number, sensor in enumerate(sensors):
        if host.model.sensor_objtype[sensor] != _SITE:
            raise PluginError(f"ray {number} of lidar {name!r} is not attached to a site")
    return sensors


def _listing(name: str, numbers: Iterator[int], count: int) -> str:
    shown = ", ".join(f"{name}-{number}" for number in islice(numbers, _MOST_NAMES))
    return f"{shown}, … ({count} in all)" if count > _MOST_NAMES else shown
