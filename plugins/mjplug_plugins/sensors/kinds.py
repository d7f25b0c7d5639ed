"""The kinds of sensors, and the MJCF sensors that each kind consists of."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import mujoco

KindName = Literal[
    "imu", "fts", "pose", "magnetometer", "rangefinder", "touch", "orientation", "scalar", "vector", "array"
]

SENSOR_NAMES = {
    int(value): name.removeprefix("mjSENS_").lower()
    for name, value in mujoco.mjtSensor.__members__.items()
    if name.startswith("mjSENS_")
}
"""The MJCF name of each sensor type."""


@dataclass(frozen=True, slots=True)
class Part:
    """One MJCF sensor that is part of a sensor.

    Attributes:
        role: Its name in the configuration.
        type: Its MJCF type; None: any type with `size` values.
        size: Number of its values; None: any number.
        optional: Whether the sensor is complete without it.
        other_endings: Endings of its name that are accepted instead of the role.
    """

    role: str
    type: str | None
    size: int | None = 3
    optional: bool = False
    other_endings: tuple[str, ...] = ()

    @property
    def endings(self) -> tuple[str, ...]:
        """The accepted endings of its name after `_`, the default first."""
        return (self.role, *self.other_endings)

    @property
    def described(self) -> str:
        """Description with an article, for messages."""
        if self.type is not None:
            return f"{'an' if self.type[0] in 'aeiou' else 'a'} {self.type}"
        return f"a sensor with {self.size} value{'s' * (self.size != 1)}"


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of sensor.

    Attributes:
        parts: Its parts; the first one determines the frame of the sensor.
        topic: Last part of its topic name.
        options: Parameters that only this kind has, in addition to the roles of its parts.
    """

    parts: tuple[Part, ...]
    topic: str
    options: frozenset[str] = frozenset()

    @property
    def composed(self) -> bool:
        """Whether it has several parts; they are found by the endings of their names."""
        return len(self.parts) > 1


_COVARIANCES = ("orientation_covariance", "angular_velocity_covariance", "linear_acceleration_covariance")

KINDS: Mapping[KindName, Kind] = {
    "imu": Kind(
        (
            Part("gyro", "gyro"),
            Part("accel", "accelerometer", other_endings=("acc",)),
            Part("quat", "framequat", 4, optional=True),
        ),
        "imu",
        frozenset(_COVARIANCES),
    ),
    "fts": Kind((Part("force", "force"), Part("torque", "torque")), "wrench", frozenset({"convention"})),
    "pose": Kind((Part("pos", "framepos"), Part("quat", "framequat", 4)), "pose"),
    "magnetometer": Kind(
        (Part("sensor", "magnetometer"),), "magnetic_field", frozenset({"magnetic_field_covariance", "field_scale"})
    ),
    "rangefinder": Kind(
        (Part("sensor", "rangefinder", 1),),
        "range",
        frozenset({"min_range", "max_range", "field_of_view", "radiation"}),
    ),
    "touch": Kind((Part("sensor", "touch", 1),), "touch"),
    "orientation": Kind((Part("sensor", "framequat", 4),), "orientation"),
    "scalar": Kind((Part("sensor", None, 1),), "value"),
    "vector": Kind((Part("sensor", None, 3),), "vector"),
    "array": Kind((Part("sensor", None, None),), "values"),
}

OWN_OPTIONS = frozenset(option for kind in KINDS.values() for option in kind.options) | frozenset(
    part.role for kind in KINDS.values() if kind.composed for part in kind.parts
)
"""Parameters that belong to some kinds only."""


def options_of(kind: KindName) -> frozenset[str]:
    """Returns the parameters in `OWN_OPTIONS` that belong to a kind."""
    roles = {part.role for part in KINDS[kind].parts} if KINDS[kind].composed else set()
    return KINDS[kind].options | roles
