"""The sensors of a model: each of its MJCF sensors, and what they make together by their names and types."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import mujoco

from mjplug.plugin import PluginError, UnknownName
from mjplug.plugin.bundled import lidar_sensors, object_names
from mjplug_plugins.sensors.kinds import KINDS, SENSOR_NAMES, Kind, KindName, Part

_RAY_NAME = re.compile(r".+-\d+", re.ASCII)
"""The rangefinders of RangefinderLidar; together they are a scan."""

_UNTYPED = {"user", "plugin"}
"""Their numbers are whatever their makers say, so nobody should guess."""

_QUATERNIONS = {"framequat", "ballquat"}


@dataclass(frozen=True, slots=True)
class Source:
    """One MJCF sensor.

    Attributes:
        name: Its name, or `sensor_<id>` if it has none.
        sensor: Its id.
        type: Its type, as MJCF calls it.
        begin: Where its numbers begin in `sensordata`.
        size: How many they are.
        noise: Standard deviation of its noise, in its own unit.
        cutoff: Where its numbers end, in its own unit; 0 is nowhere.
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
        """Whether its four numbers are a turn (w, x, y, z)."""
        return self.type in _QUATERNIONS


@dataclass(frozen=True, slots=True)
class Sensor:
    """A sensor, and the MJCF sensors that it is made of, by their roles."""

    name: str
    kind: KindName
    parts: dict[str, Source]

    @property
    def main(self) -> Source:
        """The part whose place is the sensor's."""
        return self.parts[KINDS[self.kind].parts[0].role]


def sources(model: mujoco.MjModel) -> dict[str, Source]:
    """Returns the MJCF sensors, but those that stand for a lidar; one without a name is called `sensor_<id>`."""
    lidars = lidar_sensors(model)
    found = {}
    for sensor, name in enumerate(object_names(model, mujoco.mjtObj.mjOBJ_SENSOR, "sensor", model.nsensor)):
        if name not in lidars:
            kind, size = SENSOR_NAMES[int(model.sensor_type[sensor])], int(model.sensor_dim[sensor])
            begin, noise = int(model.sensor_adr[sensor]), float(model.sensor_noise[sensor])
            found[name] = Source(name, sensor, kind, begin, size, noise, float(model.sensor_cutoff[sensor]))
    return found


def assemble(name: str, kind: KindName, names: Mapping[str, str], there: Mapping[str, Source]) -> Sensor:
    """Puts a sensor together.

    Args:
        name: Its name.
        kind: What it is.
        names: The names of its parts by their roles; an optional part may be left out.
        there: The MJCF sensors there are.

    Raises:
        PluginError: A part is missing or is of another type; the sentence has all that is wrong.
    """
    parts, wrong = {}, []
    for part in KINDS[kind].parts:
        if part.role not in names:
            continue
        source = there.get(names[part.role])
        if source is None:
            same = [other.name for other in there.values() if _fits(part, other)]
            wrong.append(str(UnknownName(part.type or "sensor", names[part.role], same)))
        elif not _fits(part, source):
            numbers = f"{source.size} number{'s' * (source.size != 1)}"
            wrong.append(f"{source.name!r} has type {source.type} and {numbers}, and {part.described} is needed")
        else:
            parts[part.role] = source
    if wrong:
        raise PluginError(f"{kind} {name!r}: {'; '.join(wrong)}")
    return Sensor(name, kind, parts)


def discovered(
    there: Mapping[str, Source], kinds: tuple[KindName, ...]
) -> tuple[list[Sensor], dict[tuple[KindName, str], str]]:
    """Returns the sensors of some kinds that the names and types of the model tell.

    Args:
        there: The MJCF sensors there are.
        kinds: The kinds.

    Returns:
        The sensors, in the order of the model; and, by kind and name, a sentence for each that lacks a part.
    """
    sensors: list[Sensor] = []
    incomplete: dict[tuple[KindName, str], str] = {}
    taken: set[str] = set()
    for name in dict.fromkeys(kinds):
        kind = KINDS[name]
        if kind.composed:
            for base, parts in _groups(kind, there).items():
                lacking = [part for part in kind.parts if part.role not in parts and not part.optional]
                if not lacking:
                    sensors.append(Sensor(base, name, parts))
                elif name != "pose":
                    need = " and ".join(f"{part.described} named {_usual_names(base, part)}" for part in lacking)
                    incomplete[name, base] = f"{name} {base!r} needs {need}"
    for sensor in sensors:
        taken |= {source.name for source in sensor.parts.values()}
    for name in dict.fromkeys(kinds):
        if not KINDS[name].composed:
            sensors += _single(name, there, taken)
    sensors.sort(key=lambda sensor: sensor.main.sensor)
    return sensors, incomplete


def _groups(kind: Kind, there: Mapping[str, Source]) -> dict[str, dict[str, Source]]:
    """Returns the parts that there are, by what their names have in common; an optional part makes no sensor."""
    groups: dict[str, dict[str, Source]] = {}
    endings = [(part, ending) for part in kind.parts for ending in part.endings]
    for part, ending in endings:
        for source in there.values():
            base = source.name.removesuffix(f"_{ending}")
            if base and base != source.name and _fits(part, source) and (not part.optional or base in groups):
                groups.setdefault(base, {}).setdefault(part.role, source)
    return groups


def _usual_names(base: str, part: Part) -> str:
    return " or ".join(f"{base}_{ending}" for ending in part.endings)


def _single(kind: KindName, there: Mapping[str, Source], taken: set[str]) -> Iterator[Sensor]:
    """Yields the sensors of one part that belong to a kind, but those that something is made of."""
    for source in there.values():
        ray = source.type == "rangefinder" and _RAY_NAME.fullmatch(source.name)
        if not ray and source.name not in taken and _kind_of(source) == kind:
            yield Sensor(source.name, kind, {KINDS[kind].parts[0].role: source})


def _kind_of(source: Source) -> KindName:
    """Returns the kind that a sensor alone is of: that of its type, else that of its size, else an array."""
    single = [(name, kind.parts[0]) for name, kind in KINDS.items() if not kind.composed]
    typed = (name for name, part in single if part.type is not None and _fits(part, source))
    sized = (name for name, part in single if part.type is None and part.size is not None and _fits(part, source))
    return next(typed, None) or (next(sized, None) if source.type not in _UNTYPED else None) or "array"


def _fits(part: Part, source: Source) -> bool:
    return part.size in (None, source.size) and part.type in (None, source.type)
