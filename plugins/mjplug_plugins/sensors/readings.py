"""Writes the values of MJCF sensors into prepared messages."""

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.plugin import CdrFrame
from mjplug_plugins.sensors.kinds import KindName
from mjplug_plugins.sensors.model_sensors import Sensor
from mjplug_plugins.sensors.parameters import SensorParameters
from mjplug_schemas.geometry_msgs import PoseStamped, QuaternionStamped, Vector3Stamped, WrenchStamped
from mjplug_schemas.message import Message
from mjplug_schemas.sensor_msgs import Imu, MagneticField, Range
from mjplug_schemas.std_msgs import Float64, Float64MultiArray, Header, MultiArrayDimension, MultiArrayLayout

Array = NDArray[np.float64]
Writer = Callable[[], object]

DEFAULT_MAX_RANGE = 1000.0
"""Longest distance of a rangefinder without a cutoff [m]."""

_NOT_MEASURED = (-1.0, *(0.0,) * 8)
"""Covariance of a value that is not measured: sensor_msgs defines -1 as its first element."""

_UNKNOWN = (0.0,) * 9

TYPES: Mapping[KindName, type[Message]] = {
    "imu": Imu,
    "fts": WrenchStamped,
    "pose": PoseStamped,
    "magnetometer": MagneticField,
    "rangefinder": Range,
    "touch": Float64,
    "orientation": QuaternionStamped,
    "scalar": Float64,
    "vector": Vector3Stamped,
    "array": Float64MultiArray,
}

STAMPED = frozenset(kind for kind, type in TYPES.items() if "header" in type.model_fields)
"""Kinds of sensors whose messages have a stamp."""


def message_of(sensor: Sensor, settings: SensorParameters, frame: str, cutoff: float, noisy: bool) -> Message:
    """Returns a sensor's message with all constant fields filled in.

    Args:
        sensor: The sensor.
        settings: The complete settings of the sensor.
        frame: Frame of the message.
        cutoff: Cutoff of its first part; 0: none.
        noisy: Whether noise is added; its variance is the covariance, unless a covariance is configured.
    """
    header = Header(frame_id=frame)

    def covariance(given: tuple[float, ...] | None, role: str, scale: float = 1.0) -> tuple[float, ...]:
        if given is not None:
            return given
        variance = (scale * sensor.parts[role].noise) ** 2 if noisy else 0.0
        return (variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance) if variance else _UNKNOWN

    if sensor.kind == "imu":
        return Imu(
            header=header,
            orientation_covariance=covariance(settings.orientation_covariance, "quat")
            if "quat" in sensor.parts
            else _NOT_MEASURED,
            angular_velocity_covariance=covariance(settings.angular_velocity_covariance, "gyro"),
            linear_acceleration_covariance=covariance(settings.linear_acceleration_covariance, "accel"),
        )
    if sensor.kind == "magnetometer":
        scale = settings.field_scale or 0.0
        return MagneticField(
            header=header,
            magnetic_field_covariance=covariance(settings.magnetic_field_covariance, "sensor", scale),
        )
    if sensor.kind == "rangefinder":
        return Range(
            header=header,
            radiation_type=Range.ULTRASOUND if settings.radiation == "ultrasound" else Range.INFRARED,
            field_of_view=settings.field_of_view or 0.0,
            min_range=settings.min_range or 0.0,
            max_range=max_range(settings, cutoff),
            variance=sensor.main.noise**2 if noisy else 0.0,
        )
    if sensor.kind == "array":
        size = sensor.main.size
        layout = MultiArrayLayout(dim=(MultiArrayDimension(label=sensor.main.type, size=size, stride=size),))
        return Float64MultiArray(layout=layout, data=(0.0,) * size)
    type = TYPES[sensor.kind]
    return type.model_validate({"header": header} if sensor.kind in STAMPED else {})


def max_range(settings: SensorParameters, cutoff: float) -> float:
    """Returns the longest distance of a rangefinder [m]."""
    return settings.max_range or cutoff or DEFAULT_MAX_RANGE


def writers(
    sensor: Sensor,
    settings: SensorParameters,
    values: Mapping[str, Array],
    frame: CdrFrame,
    cutoff: float,
    references: Mapping[str, tuple[Array, Array]],
) -> list[Writer]:
    """Returns the functions that write the current values into a message.

    Args:
        sensor: The sensor.
        settings: The complete settings of the sensor.
        values: Values of each part by role, views that change with the state.
        frame: The prepared message.
        cutoff: Cutoff of its first part; 0: none.
        references: Pose of a part's reference in the frame of the message, by role: position, shape (3,) [m], and
            rotation (w, x, y, z), shape (4,). The other parts are in the frame of the message already.
    """
    view = frame.view
    # Transformed values are stored in separate arrays and copied from there.
    transforms = [_transformed(values[role], *pose) for role, pose in references.items()]
    values = {**values, **{role: transformed for role, (transformed, _) in zip(references, transforms, strict=True)}}
    return [transform for _, transform in transforms] + _copies(sensor, settings, values, view, cutoff)


def _copies(
    sensor: Sensor,
    settings: SensorParameters,
    values: Mapping[str, Array],
    view: Callable[[str], NDArray[Any]],
    cutoff: float,
) -> list[Writer]:
    if sensor.kind == "imu":
        rotation = [_quaternion(values["quat"], view("orientation"))] if "quat" in values else []
        vectors = (("gyro", "angular_velocity"), ("accel", "linear_acceleration"))
        return rotation + [_copy(values[role], view(field)) for role, field in vectors]
    if sensor.kind == "fts":
        # MuJoCo reports the force of the parent body on the child body; the load has the opposite sign.
        sign = -1.0 if settings.convention == "load" else 1.0
        return [partial(np.multiply, values[role], sign, view(f"wrench.{role}")) for role in ("force", "torque")]
    if sensor.kind == "pose":
        position = _copy(values["pos"], view("pose.position"))
        return [position, _quaternion(values["quat"], view("pose.orientation"))]
    if sensor.kind == "magnetometer":
        return [partial(np.multiply, values["sensor"], settings.field_scale or 0.0, view("magnetic_field"))]
    if sensor.kind == "rangefinder":
        bounds = settings.min_range or 0.0, max_range(settings, cutoff)
        return [partial(_write_range, values["sensor"], *bounds, view("range"))]
    if sensor.kind == "orientation":
        return [_quaternion(values["sensor"], view("quaternion"))]
    return [_copy(values["sensor"], view("vector" if sensor.kind == "vector" else "data"))]


def _transformed(source: Array, shift: Array, rotation: Array) -> tuple[Array, Writer]:
    """Returns an array with `source` transformed by a pose, and the function that updates the array."""
    target = np.zeros(source.size)
    if source.size == 4:
        return target, partial(mujoco.mju_mulQuat, target, rotation, source)

    def transform() -> None:
        mujoco.mju_rotVecQuat(target, source, rotation)
        np.add(target, shift, target)

    return target, transform


def _copy(source: Array, target: Array) -> Writer:
    # For a few values, memoryviews take a third of numpy's time.
    here, there = target.data.cast("B"), source.data.cast("B")
    return partial(here.__setitem__, slice(None), there)


def _quaternion(wxyz: Array, xyzw: Array) -> Writer:
    here, there = xyzw.data.cast("B").cast("d"), wxyz.data.cast("B").cast("d")
    imaginary, real = there[1:], there[:1]

    def fill() -> None:
        here[:3] = imaginary
        here[3:] = real

    return fill


def _write_range(source: Array, low: float, high: float, target: NDArray[np.float32]) -> None:
    distance = float(source[0])
    # MuJoCo returns -1 if there is nothing, and the cutoff for larger distances.
    if distance < 0.0 or distance >= high:
        distance = math.inf
    elif distance < low:
        distance = -math.inf
    target[0] = distance
