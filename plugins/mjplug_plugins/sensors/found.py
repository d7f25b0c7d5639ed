"""The sensors of a model: each of its MJCF sensors, and what they make together by their names and types."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import mujoco

from mjplug.plugin import PluginError, UnknownName
from mjplug_plugins.sensors.kinds import KINDS, SENSOR_NAMES, Kind, KindName, Part

_RAY_NAME = re.compile(r".+-\d+", re.ASCII)
"""The rangefinders of RangefinderLidar; together they are a scan."""

_UNTYPED = {"user", "plugin"}
"""Their numbers are whatever their makers say, so nobody should guess."""


@dataclass(frozen=True, slots=True)
class Source:
    """One MJCF sensor.

    Attributes:
        name: Its name.
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
    """Returns the MJCF sensors that have a name."""
    found = {}
    for sensor in range(model.nsensor):
        if name := mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_SENSOR, sensor):
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
            wanted = f"a {part.type}" if part.type else f"one of {part.size} number{'s' * (part.size > 1)}"
            numbers = f" of {source.size} number{'s' * (source.size > 1)}"
            wrong.append(f"{source.name!r} is a {source.type}{numbers}, and {wanted} is needed")
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
                    need = " and ".join(f"a {part.type} named {base}_{part.role}" for part in lacking)
                    incomplete[name, base] = f"{name} {base!r} needs {need}"
    for sensor in sensors:
        taken |= {source.name for source in sensor.parts.values()}
    for name in dict.fromkeys(kinds):
        if not KINDS[name].composed:
            sensors += _single(name, KINDS[name].parts[0], there, taken)
    sensors.sort(key=lambda sensor: sensor.main.sensor)
    return sensors, incomplete


def _groups(kind: Kind, there: Mapping[str, Source]) -> dict[str, dict[str, Source]]:
    """Returns the parts that there are, by what their names have in common; an optional part makes no sensor."""
    groups: dict[str, dict[str, Source]] = {}
    for part in kind.parts:
        for source in there.values():
            base = source.name.removesuffix(f"_{part.role}")
            if base and base != source.name and _fits(part, source) and (not part.optional or base in groups):
                groups.setdefault(base, {})[part.role] = source
    return groups


def _single(kind: KindName, part: Part, there: Mapping[str, Source], taken: set[str]) -> Iterator[Sensor]:
    """Yields the sensors of one part; of `scalar` and `vector`, those that nothing else is made of."""
    others = {other.parts[0].type for other in KINDS.values() if not other.composed}
    for source in there.values():
        if not _fits(part, source) or _RAY_NAME.fullmatch(source.name):
            continue
        if part.type is not None or not (source.type in _UNTYPED | others or source.name in taken):
            yield Sensor(source.name, kind, {part.role: source})


def _fits(part: Part, source: Source) -> bool:
    return source.size == part.size and part.type in (None, source.type)
