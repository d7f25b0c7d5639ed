"""Finds the sensors of a model: its MJCF sensors, and groups of them by name and type."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import mujoco

from mjplug.plugin import PluginError, UnknownName
from mjplug.plugin.bundled import lidar_sensors, object_names
from mjplug_plugins.sensors.kinds import KINDS, SENSOR_NAMES, Kind, KindName, Part

_RAY_NAME = re.compile(r".+-\d+", re.ASCII)
"""Names of rangefinders that RangefinderLidar publishes as a scan."""

_UNTYPED = {"user", "plugin"}
"""Types whose values have no defined meaning."""

_QUATERNIONS = {"framequat", "ballquat"}


@dataclass(frozen=True, slots=True)
class Source:
    """One MJCF sensor.

    Attributes:
        name: Its name, or `sensor_<id>` if it has none.
        sensor: Its id.
        type: Its MJCF type.
        begin: Start index of its values in `sensordata`.
        size: Number of its values.
        noise: Standard deviation of its noise, in the unit of the sensor.
        cutoff: Largest absolute value, in the unit of the sensor; 0: no limit.
    """

    name: str
    sensor: int
    type: str
    begin: int
    size: int
    noise: float
    cutoff: float

    @property
    def is_quaternion(self) -> bool:
        """Whether its four values are a quaternion (w, x, y, z)."""
        return self.type in _QUATERNIONS


@dataclass(frozen=True, slots=True)
class Sensor:
    """A sensor and its parts, the MJCF sensors, by role."""

    name: str
    kind: KindName
    parts: dict[str, Source]

    @property
    def main(self) -> Source:
        """The part that determines the frame of the sensor."""
        return self.parts[KINDS[self.kind].parts[0].role]


def sources(model: mujoco.MjModel) -> dict[str, Source]:
    """Returns the MJCF sensors by name, without lidars; a sensor without a name is called `sensor_<id>`."""
    lidars = lidar_sensors(model)
    by_name = {}
    for sensor, name in enumerate(object_names(model, mujoco.mjtObj.mjOBJ_SENSOR, "sensor", model.nsensor)):
        if name not in lidars:
            kind, size = SENSOR_NAMES[int(model.sensor_type[sensor])], int(model.sensor_dim[sensor])
            begin, noise = int(model.sensor_adr[sensor]), float(model.sensor_noise[sensor])
            by_name[name] = Source(name, sensor, kind, begin, size, noise, float(model.sensor_cutoff[sensor]))
    return by_name


def assemble(name: str, kind: KindName, names: Mapping[str, str], available: Mapping[str, Source]) -> Sensor:
    """Builds a sensor from its parts.

    Args:
        name: Its name.
        kind: Its kind.
        names: Names of its parts by role; an optional part may be omitted.
        available: All MJCF sensors, by name.

    Raises:
        PluginError: A part is missing or has another type; the message lists all problems.
    """
    parts, errors = {}, []
    for part in KINDS[kind].parts:
        if part.role not in names:
            continue
        source = available.get(names[part.role])
        if source is None:
            same = [other.name for other in available.values() if _fits(part, other)]
            errors.append(str(UnknownName(part.type or "sensor", names[part.role], same)))
        elif not _fits(part, source):
            values = f"{source.size} value{'s' * (source.size != 1)}"
            errors.append(f"{source.name!r} has type {source.type} and {values}, but {part.described} is required")
        else:
            parts[part.role] = source
    if errors:
        raise PluginError(f"{kind} {name!r}: {'; '.join(errors)}")
    return Sensor(name, kind, parts)


def discovered(
    available: Mapping[str, Source], kinds: tuple[KindName, ...]
) -> tuple[list[Sensor], dict[tuple[KindName, str], str]]:
    """Returns the sensors of some kinds that are found by the names and types in the model.

    Args:
        available: All MJCF sensors, by name.
        kinds: The kinds to find.

    Returns:
        The sensors, in the order of the model; and, by kind and name, a message for each incomplete sensor.
    """
    sensors: list[Sensor] = []
    incomplete: dict[tuple[KindName, str], str] = {}
    taken: set[str] = set()
    for name in dict.fromkeys(kinds):
        kind = KINDS[name]
        if kind.composed:
            for base, parts in _groups(kind, available).items():
                missing = [part for part in kind.parts if part.role not in parts and not part.optional]
                if not missing:
                    sensors.append(Sensor(base, name, parts))
                elif name != "pose":
                    required = " and ".join(f"{part.described} named {_usual_names(base, part)}" for part in missing)
                    incomplete[name, base] = f"{name} {base!r} needs {required}"
    for sensor in sensors:
        taken |= {source.name for source in sensor.parts.values()}
    for name in dict.fromkeys(kinds):
        if not KINDS[name].composed:
            sensors += _single(name, available, taken)
    sensors.sort(key=lambda sensor: sensor.main.sensor)
    return sensors, incomplete


def _groups(kind: Kind, available: Mapping[str, Source]) -> dict[str, dict[str, Source]]:
    """Returns the parts of a kind, grouped by the common part of their names; an optional part forms no group."""
    groups: dict[str, dict[str, Source]] = {}
    endings = [(part, ending) for part in kind.parts for ending in part.endings]
    for part, ending in endings:
        for source in available.values():
            base = source.name.removesuffix(f"_{ending}")
            if base and base != source.name and _fits(part, source) and (not part.optional or base in groups):
                groups.setdefault(base, {}).setdefault(part.role, source)
    return groups


def _usual_names(base: str, part: Part) -> str:
    return " or ".join(f"{base}_{ending}" for ending in part.endings)


def _single(kind: KindName, available: Mapping[str, Source], taken: set[str]) -> Iterator[Sensor]:
    """Yields the sensors of a kind with a single part, without those that are parts of other sensors."""
    for source in available.values():
        ray = source.type == "rangefinder" and _RAY_NAME.fullmatch(source.name)
        if not ray and source.name not in taken and _kind_of(source) == kind:
            yield Sensor(source.name, kind, {KINDS[kind].parts[0].role: source})


def _kind_of(source: Source) -> KindName:
    """Returns the kind of a single MJCF sensor: by its type, else by its size, else `array`."""
    single = [(name, kind.parts[0]) for name, kind in KINDS.items() if not kind.composed]
    typed = (name for name, part in single if part.type is not None and _fits(part, source))
    sized = (name for name, part in single if part.type is None and part.size is not None and _fits(part, source))
    return next(typed, None) or (next(sized, None) if source.type not in _UNTYPED else None) or "array"


def _fits(part: Part, source: Source) -> bool:
    return part.size in (None, source.size) and part.type in (None, source.type)
