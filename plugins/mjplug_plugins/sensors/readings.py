"""From the numbers of MJCF sensors to messages that are kept ready."""

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.plugin import CdrFrame
from mjplug_plugins.sensors.found import Sensor
from mjplug_plugins.sensors.kinds import KindName
from mjplug_plugins.sensors.parameters import SensorParameters
from mjplug_schemas.geometry_msgs import PoseStamped, QuaternionStamped, Vector3Stamped, WrenchStamped
from mjplug_schemas.message import Message
from mjplug_schemas.sensor_msgs import Imu, MagneticField, Range
from mjplug_schemas.std_msgs import Float64, Float64MultiArray, Header, MultiArrayDimension, MultiArrayLayout

Array = NDArray[np.float64]
Fill = Callable[[], object]

DEFAULT_MAX_RANGE = 1000.0
"""Of a rangefinder without a cutoff [m]."""

_NOT_MEASURED = (-1.0, *(0.0,) * 8)
"""The covariance that says so."""

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
"""The kinds whose messages have a stamp."""


def message_of(sensor: Sensor, settings: SensorParameters, frame: str, cutoff: float, noisy: bool) -> Message:
    """Returns a sensor's message as far as it never changes.

    Args:
        sensor: The sensor.
        settings: What is configured, complete.
        frame: Its frame.
        cutoff: The cutoff of its first part; 0 is none.
        noisy: Whether noise is added; its variance then is the covariance, unless that is configured.
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
    """Returns how far a rangefinder sees [m]."""
    return settings.max_range or cutoff or DEFAULT_MAX_RANGE


def fills(
    sensor: Sensor,
    settings: SensorParameters,
    values: Mapping[str, Array],
    frame: CdrFrame,
    cutoff: float,
    references: Mapping[str, tuple[Array, Array]],
) -> list[Fill]:
    """Returns what writes the present values into a message.

    Args:
        sensor: The sensor.
        settings: What is configured, complete.
        values: The numbers of each part, by its role; arrays that change in place.
        frame: The message.
        cutoff: The cutoff of its first part; 0 is none.
        references: Where the reference of a part is in the message's frame, by its role: position and turn (w, x, y,
            z), shapes (3,) and (4,). A part that is not in it is in that frame already.
    """
    view = frame.view
    # What is written into arrays of our own is copied from there.
    moves = [_moved(values[role], *place) for role, place in references.items()]
    values = {**values, **{role: moved for role, (moved, _) in zip(references, moves, strict=True)}}
    return [move for _, move in moves] + _copies(sensor, settings, values, view, cutoff)


def _copies(
    sensor: Sensor,
    settings: SensorParameters,
    values: Mapping[str, Array],
    view: Callable[[str], NDArray[Any]],
    cutoff: float,
) -> list[Fill]:
    if sensor.kind == "imu":
        turn = [_quaternion(values["quat"], view("orientation"))] if "quat" in values else []
        vectors = (("gyro", "angular_velocity"), ("accel", "linear_acceleration"))
        return turn + [_copy(values[role], view(field)) for role, field in vectors]
    if sensor.kind == "fts":
        # MuJoCo has what the side towards the world exerts on the side that hangs on the sensor.
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


def _moved(source: Array, shift: Array, turn: Array) -> tuple[Array, Fill]:
    """Returns an array for what is known from a place, as seen from where that is; and what brings it up to date."""
    target = np.zeros(source.size)
    if source.size == 4:
        return target, partial(mujoco.mju_mulQuat, target, turn, source)

    def move() -> None:
        mujoco.mju_rotVecQuat(target, source, turn)
        np.add(target, shift, target)

    return target, move


def _copy(source: Array, target: Array) -> Fill:
    # For a few numbers, memoryviews cost a third of what numpy does.
    here, there = target.data.cast("B"), source.data.cast("B")
    return partial(here.__setitem__, slice(None), there)


def _quaternion(wxyz: Array, xyzw: Array) -> Fill:
    here, there = xyzw.data.cast("B").cast("d"), wxyz.data.cast("B").cast("d")
    imaginary, real = there[1:], there[:1]

    def fill() -> None:
        here[:3] = imaginary
        here[3:] = real

    return fill


def _write_range(source: Array, low: float, high: float, target: NDArray[np.float32]) -> None:
    distance = float(source[0])
    # MuJoCo says -1 where there is nothing, and the cutoff itself beyond it.
    if distance < 0.0 or distance >= high:
        distance = math.inf
    elif distance < low:
        distance = -math.inf
    target[0] = distance
