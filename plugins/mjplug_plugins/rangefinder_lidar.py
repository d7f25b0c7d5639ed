"""Publishes groups of MuJoCo rangefinder sensors as laser scans, for models that contain one rangefinder per ray."""

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
"""The last ray may miss `max_angle` by this much, because angles in files are rounded [increments]."""

_MAX_NAMES = 20


class LidarParameters(Parameters):
    """Parameters of one lidar, under its name."""

    frame_name: str = Field(description="Frame of the scan.")
    min_angle: float = Field(description="Angle of ray 0 [rad].")
    max_angle: float = Field(description="Angle of the last ray, or a limit for it [rad].")
    angle_increment: float = Field(description="Angle between two rays [rad].")
    range_min: float = Field(default=0.0, ge=0, description="Shortest distance that can be measured [m].")
    range_max: float = Field(
        default=1000.0, gt=0, validate_default=True, description="Longest distance that can be measured [m]."
    )
    laserscan_topic: str = Field(default="{ns}/scan", description="Topic name.")

    @property
    def rays(self) -> int:
        """Number of rays from `min_angle` to `max_angle`, both included."""
        return math.floor(self._increments + _TOLERANCE) + 1

    @property
    def truncated_rays(self) -> int:
        """The same number truncated, without the tolerance; models generated this way contain one ray too few."""
        return int(self._increments) + 1

    @property
    def _increments(self) -> float:
        return (self.max_angle - self.min_angle) / self.angle_increment

    @field_validator("angle_increment")
    @classmethod
    def _leads_to_max_angle(cls, increment: float, info: ValidationInfo) -> float:
        if not increment:
            raise ValueError("angle_increment must not be 0")
        if {"min_angle", "max_angle"} <= info.data.keys():
            low, high = info.data["min_angle"], info.data["max_angle"]
            if (high - low) / increment < 0:
                raise ValueError(f"{increment:g} has the wrong sign: min_angle is {low:g} and max_angle is {high:g}")
            if not math.isfinite((high - low) / increment):
                raise ValueError(f"{increment:g} is too small: the number of rays is not finite")
        return increment

    @field_validator("range_max")
    @classmethod
    def _above_range_min(cls, range_max: float, info: ValidationInfo) -> float:
        if range_max <= info.data.get("range_min", 0.0):
            raise ValueError(f"range_max ({range_max:g}) must be above range_min ({info.data['range_min']:g})")
        return range_max


class RangefinderLidarParameters(Parameters):
    """Parameters of RangefinderLidar; every other key is the name of a lidar and contains LidarParameters."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Annotated[LidarParameters, NestedParameters]]

    lidar_publish_rate: float = Field(
        default=5.0, gt=0, description="Scans per second of simulated time, for every lidar [Hz]."
    )


class RangefinderLidar(Plugin[RangefinderLidarParameters]):
    """Publishes rangefinder sensors named `<lidar>-0`, `<lidar>-1`, … as one `sensor_msgs/LaserScan`.

    Each lidar is configured under its name with `frame_name`, `min_angle`, `max_angle` and `angle_increment` [rad], and
    optionally `range_min`, `range_max` [m] and `laserscan_topic`. A range is inf if nothing is in range, and -inf if
    something is too close. A scan shows the state at its stamp.
    """

    stateless = True

    def init(self, host: Host, parameters: RangefinderLidarParameters) -> None:
        """Finds the rays of each lidar and starts the timers."""
        groups = _groups(host.model)
        configured = parameters.__pydantic_extra__
        if not configured and groups:
            raise PluginError(
                "no lidar is configured; set frame_name, min_angle, max_angle and angle_increment under the name of "
                f"one of: {', '.join(sorted(groups))}"
            )
        if not configured:
            host.logger.warning("the model has no rangefinder named <lidar>-<number>: nothing is published")
        for name, lidar in configured.items():
            if name not in groups:
                raise UnknownName("rangefinder lidar", name, groups)
            sensors = _sensors(host, name, lidar, groups[name])
            scan = _Scan(host, lidar, sensors, 1.0 / parameters.lidar_publish_rate)
            host.create_timer(1.0 / parameters.lidar_publish_rate, scan.publish, while_matched=scan.publisher)
        if unconfigured := sorted(groups.keys() - configured.keys()) if configured else []:
            host.logger.warning("not published, because no parameters are set for them: %s", ", ".join(unconfigured))


class _Scan:
    """The rays, message and publisher of one lidar.

    This class casts the rays itself, in the same way as MuJoCo's sensors, because after a step the sensor values belong
    to the state before the step.

    Attributes:
        publisher: The publisher.
    """

    def __init__(self, host: Host, lidar: LidarParameters, sensors: list[int], period: float) -> None:
        model, data = host.model, host.data
        self._host = host
        self.publisher: Publisher[LaserScan] = host.create_publisher(
            LaserScan, lidar.laserscan_topic, sample=self.sample
        )
        sites = model.sensor_objid[sensors]
        self._rays = [
            (data.site_xpos[s], data.site_xmat[s].reshape(3, 3)[:, 2], int(model.site_bodyid[s])) for s in sites
        ]
        # MuJoCo reports the cutoff for every distance beyond it.
        cutoff = model.sensor_cutoff[sensors]
        self._max_range = np.minimum(lidar.range_max, np.where(cutoff > 0, cutoff, np.inf))
        self._min_range = lidar.range_min
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
        """Casts all rays and publishes the scan."""
        self.publisher.publish_frame(self.sample())

    def sample(self) -> CdrFrame:
        """Casts all rays and returns the scan."""
        host = self._host
        host.kinematics()
        distances = np.array([self._cast(*ray) for ray in self._rays])
        no_return = (distances < 0.0) | (distances > self._max_range)
        too_close = (distances < self._min_range) & ~no_return
        self._ranges[:] = np.select([no_return, too_close], [np.inf, -np.inf], distances)
        self._message.set_stamp("header.stamp", host.time_ns)
        return self._message

    def _cast(self, origin: NDArray[np.float64], direction: NDArray[np.float64], body: int) -> float:
        return mujoco.mj_ray(self._host.model, self._host.data, origin, direction, None, True, body, self._geom)


def _groups(model: mujoco.MjModel) -> dict[str, dict[int, int]]:
    """Returns the rangefinders named `<lidar>-<number>` as a dict of lidar name to ray number to sensor id."""
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
    """Returns the sensor id of each ray, in the order of the angles.

    Raises:
        PluginError: A ray is missing, or is not attached to a site.
    """
    rays = lidar.rays
    missing = rays - sum(number < rays for number in group)
    if missing == 1 and rays - 1 not in group and lidar.truncated_rays == rays - 1:
        rays -= 1
        host.logger.warning(
            "lidar %r: the model has no ray %d at max_angle = %g, so the scan ends at %g; the model was probably "
            "generated with (max_angle - min_angle) / angle_increment truncated",
            name,
            rays,
            lidar.max_angle,
            lidar.min_angle + (rays - 1) * lidar.angle_increment,
        )
    elif missing:
        raise PluginError(
            f"lidar {name!r} has {rays} rays according to its angles, but the model has no rangefinder named "
            f"{_listing(name, (i for i in range(rays) if i not in group), missing)}"
        )
    if beyond := [number for number in group if number >= rays]:
        host.logger.warning(
            "lidar %r: %d rays, from %s-%d on, are beyond max_angle and are not published",
            name,
            len(beyond),
            name,
            min(beyond),
        )
    sensors = [group[number] for number in range(rays)]
    for number, sensor in enumerate(sensors):
        if host.model.sensor_objtype[sensor] != _SITE:
            raise PluginError(f"ray {number} of lidar {name!r} is not attached to a site")
    return sensors


def _listing(name: str, numbers: Iterator[int], count: int) -> str:
    shown = ", ".join(f"{name}-{number}" for number in islice(numbers, _MAX_NAMES))
    return f"{shown}, … ({count} in all)" if count > _MAX_NAMES else shown
