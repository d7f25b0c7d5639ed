"""What can be set about sensors."""

import math
from typing import Annotated, Literal

from pydantic import AfterValidator, ConfigDict, Field, ValidationInfo, field_validator

from mjplug.plugin import NestedParameters, Parameters
from mjplug_plugins.sensors.kinds import KindName


def _covariance(numbers: tuple[float, ...]) -> tuple[float, ...]:
    """Returns all nine numbers of a 3x3 covariance.

    Raises:
        ValueError: There are neither three, the diagonal, nor nine.
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

    type: KindName | None = Field(default=None, description="What it is; none is what its name in the model tells.")
    enabled: bool = Field(default=True, description="Whether it is published.")
    sensor: str | None = Field(
        default=None, description="Its name in the model, without endings such as `_gyro`; none is the same name."
    )
    topic: str | None = Field(default=None, description="Topic name; none is `<name>/<what it is>`.")
    frame_id: str | None = Field(default=None, description="Frame of its messages; none is what the model says.")
    rate: float | None = Field(
        default=None, gt=0, description="Messages per second of simulated time [Hz]; none is `rate`."
    )
    noise: bool | None = Field(default=None, description="Whether noise is added; none is `noise`.")
    gyro: str | None = Field(default=None, description="Gyro of an imu; none is `<sensor>_gyro`.")
    accel: str | None = Field(default=None, description="Accelerometer of an imu; none is `<sensor>_accel`.")
    quat: str | None = Field(
        default=None, description="Orientation of an imu or pose, a framequat; none is `<sensor>_quat`."
    )
    pos: str | None = Field(default=None, description="Position of a pose, a framepos; none is `<sensor>_pos`.")
    force: str | None = Field(default=None, description="Force sensor of an fts; none is `<sensor>_force`.")
    torque: str | None = Field(default=None, description="Torque sensor of an fts; none is `<sensor>_torque`.")
    convention: Literal["load", "mujoco"] | None = Field(
        default=None, description="Sign of an fts; none is `fts_convention`."
    )
    orientation_covariance: Covariance | None = Field(default=None, description="Of an imu, 3 or 9 numbers [rad²].")
    angular_velocity_covariance: Covariance | None = Field(
        default=None, description="Of an imu, 3 or 9 numbers [(rad/s)²]."
    )
    linear_acceleration_covariance: Covariance | None = Field(
        default=None, description="Of an imu, 3 or 9 numbers [(m/s²)²]."
    )
    magnetic_field_covariance: Covariance | None = Field(
        default=None, description="Of a magnetometer, 3 or 9 numbers [T²]."
    )
    field_scale: float | None = Field(
        default=None,
        description="Of a magnetometer: tesla per unit of the model's `magnetic`; none is `field_scale` [T].",
    )
    min_range: float | None = Field(default=None, ge=0, description="Of a rangefinder; none is 0 [m].")
    max_range: float | None = Field(
        default=None, gt=0, description="Of a rangefinder; none is its cutoff, or 1000 without one [m]."
    )
    field_of_view: float | None = Field(
        default=None, ge=0, le=math.tau, description="What a rangefinder says its cone opens to; none is 0 [rad]."
    )
    radiation: Literal["ultrasound", "infrared"] | None = Field(
        default=None, description="What a rangefinder says it sends out; none is `infrared`."
    )

    @field_validator("max_range")
    @classmethod
    def _above_min_range(cls, max_range: float | None, info: ValidationInfo) -> float | None:
        low = info.data.get("min_range")
        if max_range is not None and low is not None and max_range <= low:
            raise ValueError(f"{max_range:g} is not above min_range, which is {low:g}")
        return max_range


class SensorsParameters(Parameters):
    """Parameters of Sensors; every other name is that of a sensor, with SensorParameters below it."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Annotated[SensorParameters, NestedParameters]]

    rate: float = Field(default=100.0, gt=0, description="Messages per second of simulated time, of every sensor [Hz].")
    discover: tuple[KindName, ...] = Field(
        default=("imu", "fts", "pose", "magnetometer", "rangefinder", "touch", "orientation", "array"),
        strict=False,
        description="Kinds of sensors that are found in the model; `scalar` and `vector` may be added.",
    )
    noise: bool = Field(default=False, description="Whether gaussian noise, as the model's `noise` says, is added.")
    fts_convention: Literal["load", "mujoco"] = Field(
        default="load",
        description="Sign of forces and torques: `load` is what the sensor carries, `mujoco` the opposite.",
    )
    world_frame: str = Field(default="world", description="Frame of what the model measures in the world.")
    field_scale: float = Field(
        default=1.0, description="Tesla per unit of the model's `magnetic`; 1e-4 if that is in gauss [T]."
    )
