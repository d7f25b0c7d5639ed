"""Parameters of the plugin and of each sensor."""

import math
from typing import Annotated, Literal

from pydantic import AfterValidator, ConfigDict, Field, ValidationInfo, field_validator

from mjplug.plugin import NestedParameters, OneOrMore, Parameters
from mjplug_plugins.sensors.kinds import KindName


def _covariance(numbers: tuple[float, ...]) -> tuple[float, ...]:
    """Returns all nine values of a 3x3 covariance, row by row.

    Raises:
        ValueError: The number of values is neither 3 (the diagonal) nor 9.
    """
    if len(numbers) == 3:
        x, y, z = numbers
        return (x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z)
    if len(numbers) != 9:
        raise ValueError(f"a covariance has 3 numbers (its diagonal) or 9, not {len(numbers)}")
    return numbers


Covariance = Annotated[tuple[float, ...], AfterValidator(_covariance), Field(strict=False)]


class SensorParameters(Parameters):
    """Parameters of one sensor, under its name."""

    type: KindName | None = Field(
        default=None, description="Kind of the sensor; default: found by its name in the model."
    )
    enabled: bool = Field(default=True, description="Whether the sensor is published.")
    sensor: str | None = Field(
        default=None, description="Name in the model, without endings such as `_gyro`; default: the same name."
    )
    topic: str | None = Field(
        default=None, description="Topic name; default: `<name>/<kind>`, such as `imu` or `wrench`."
    )
    frame_id: str | None = Field(default=None, description="Frame of the messages; default: the frame in the model.")
    rate: float | None = Field(
        default=None, gt=0, description="Messages per second of simulated time [Hz]; default: `rate` of the plugin."
    )
    noise: bool | None = Field(default=None, description="Whether noise is added; default: `noise` of the plugin.")
    gyro: str | None = Field(default=None, description="Gyro of an imu; default: `<sensor>_gyro`.")
    accel: str | None = Field(default=None, description="Accelerometer of an imu; default: `<sensor>_accel`.")
    quat: str | None = Field(
        default=None, description="Orientation of an imu or pose, a framequat; default: `<sensor>_quat`."
    )
    pos: str | None = Field(default=None, description="Position of a pose, a framepos; default: `<sensor>_pos`.")
    force: str | None = Field(default=None, description="Force sensor of an fts; default: `<sensor>_force`.")
    torque: str | None = Field(default=None, description="Torque sensor of an fts; default: `<sensor>_torque`.")
    convention: Literal["load", "mujoco"] | None = Field(
        default=None, description="Sign convention of an fts; default: `fts_convention`."
    )
    orientation_covariance: Covariance | None = Field(
        default=None, description="Orientation covariance of an imu, 3 or 9 numbers [rad²]."
    )
    angular_velocity_covariance: Covariance | None = Field(
        default=None, description="Angular velocity covariance of an imu, 3 or 9 numbers [(rad/s)²]."
    )
    linear_acceleration_covariance: Covariance | None = Field(
        default=None, description="Linear acceleration covariance of an imu, 3 or 9 numbers [(m/s²)²]."
    )
    magnetic_field_covariance: Covariance | None = Field(
        default=None, description="Covariance of a magnetometer, 3 or 9 numbers [T²]."
    )
    field_scale: float | None = Field(
        default=None,
        description="For a magnetometer: tesla per unit of the model's `magnetic`; default: the plugin's [T].",
    )
    min_range: float | None = Field(
        default=None, ge=0, description="Shortest distance of a rangefinder [m]; default: 0."
    )
    max_range: float | None = Field(
        default=None,
        gt=0,
        description="Longest distance of a rangefinder [m]; default: its cutoff, or 1000 without a cutoff.",
    )
    field_of_view: float | None = Field(
        default=None, ge=0, le=math.tau, description="Published `field_of_view` of a rangefinder [rad]; default: 0."
    )
    radiation: Literal["ultrasound", "infrared"] | None = Field(
        default=None, description="Published radiation type of a rangefinder; default: `infrared`."
    )

    @field_validator("max_range")
    @classmethod
    def _above_min_range(cls, max_range: float | None, info: ValidationInfo) -> float | None:
        low = info.data.get("min_range")
        if max_range is not None and low is not None and max_range <= low:
            raise ValueError(f"max_range ({max_range:g}) must be above min_range ({low:g})")
        return max_range


class SensorsParameters(Parameters):
    """Parameters of Sensors; every other key is the name of a sensor and contains SensorParameters."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Annotated[SensorParameters, NestedParameters]]

    rate: float = Field(
        default=100.0, gt=0, description="Messages per second of simulated time, for every sensor [Hz]."
    )
    discover: Annotated[tuple[KindName, ...], OneOrMore] = Field(
        default=("imu", "fts", "pose", "magnetometer", "rangefinder", "touch", "orientation", "array"),
        description="Kinds of sensors to find in the model; `scalar` and `vector` can be added.",
    )
    noise: bool = Field(
        default=False, description="Whether Gaussian noise is added; `noise` in the model is its standard deviation."
    )
    fts_convention: Literal["load", "mujoco"] = Field(
        default="load",
        description="Sign of forces and torques: `load`: the load on the sensor, `mujoco`: the opposite sign.",
    )
    world_frame: str = Field(default="world", description="Frame of values that the model measures in the world frame.")
    field_scale: float = Field(
        default=1.0, description="Tesla per unit of the model's `magnetic`; 1e-4 if `magnetic` is in gauss [T]."
    )
