"""Which sensors are published, of those that the model has and those that are configured."""

from collections.abc import Mapping

import mujoco

from mjplug.plugin import Host, PluginError, UnknownName
from mjplug_plugins.sensors.found import Sensor, Source, assemble, discovered, sources
from mjplug_plugins.sensors.kinds import KINDS, OWN_OPTIONS, KindName, options_of
from mjplug_plugins.sensors.parameters import SensorParameters, SensorsParameters


def chosen(host: Host, parameters: SensorsParameters) -> list[tuple[Sensor, SensorParameters]]:
    """Returns the sensors to publish: those configured, then those found that are not configured.

    Raises:
        PluginError: A configured one cannot be made; the sentence has all that is wrong.
    """
    there = sources(host.model)
    everything, _ = discovered(there, tuple(KINDS))
    chosen: list[tuple[Sensor, SensorParameters]] = []
    settled: set[tuple[KindName, str]] = set()
    wrong: list[str] = []
    for name, settings in parameters.__pydantic_extra__.items():
        try:
            base, kinds = settings.sensor or name, _kinds(name, settings, everything)
            settled |= {(kind, base) for kind in kinds}
            if settings.enabled:
                chosen.append((_made(host.model, name, base, kinds, settings, there), settings))
        except (PluginError, UnknownName) as error:
            wrong.append(str(error))
    if wrong:
        raise PluginError("; ".join(wrong))
    found, incomplete = discovered(there, parameters.discover)
    if lacking := [sentence for key, sentence in incomplete.items() if key not in settled]:
        host.logger.warning("not published: %s", "; ".join(lacking))
    return chosen + [(own, SensorParameters()) for own in found if (own.kind, own.name) not in settled]


def _kinds(name: str, settings: SensorParameters, everything: list[Sensor]) -> list[KindName]:
    """Returns what a configured sensor can be.

    Raises:
        UnknownName: Neither the model nor the configuration tells.
    """
    if settings.type is not None:
        return [settings.type]
    base = settings.sensor or name
    if told := [sensor.kind for sensor in everything if sensor.name == base]:
        return told
    given = settings.model_fields_set & OWN_OPTIONS
    if given and (possible := [kind for kind in KINDS if given <= options_of(kind)]):
        return possible
    raise UnknownName("sensor", base, (sensor.name for sensor in everything))


def _made(
    model: mujoco.MjModel,
    name: str,
    base: str,
    kinds: list[KindName],
    settings: SensorParameters,
    there: Mapping[str, Source],
) -> Sensor:
    """Puts a configured sensor together.

    Raises:
        PluginError: It is not clear what it is, it lacks a part, or it has a parameter of another kind.
    """
    if len(kinds) > 1:
        raise PluginError(f"sensor {name!r} can be {' or '.join(kinds)}; give its type")
    (kind,) = kinds
    if foreign := sorted(settings.model_fields_set & OWN_OPTIONS - options_of(kind)):
        raise PluginError(f"sensor {name!r} is of type {kind}, which has no {', '.join(foreign)}")
    if not KINDS[kind].composed:
        return assemble(name, kind, {"sensor": base}, there)
    names = {}
    for part in KINDS[kind].parts:
        given: str | None = getattr(settings, part.role)
        candidates = [f"{base}_{ending}" for ending in part.endings]
        usual = next((candidate for candidate in candidates if candidate in there), candidates[0])
        if given is not None or not part.optional or usual in there:
            names[part.role] = given if given is not None else usual
    return assemble(name, kind, names, there)
