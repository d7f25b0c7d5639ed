"""Selects the sensors to publish from the model and the configuration."""

from collections.abc import Mapping

import mujoco

from mjplug.plugin import Host, PluginError, UnknownName
from mjplug_plugins.sensors.kinds import KINDS, OWN_OPTIONS, KindName, options_of
from mjplug_plugins.sensors.model_sensors import Sensor, Source, assemble, discovered, sources
from mjplug_plugins.sensors.parameters import SensorParameters, SensorsParameters


def chosen(host: Host, parameters: SensorsParameters) -> list[tuple[Sensor, SensorParameters]]:
    """Returns the sensors to publish: the configured ones, then those found in the model.

    Raises:
        PluginError: A configured sensor is invalid; the message lists all problems.
    """
    sources_by_name = sources(host.model)
    all_sensors, _ = discovered(sources_by_name, tuple(KINDS))
    chosen: list[tuple[Sensor, SensorParameters]] = []
    configured: set[tuple[KindName, str]] = set()
    errors: list[str] = []
    for name, settings in parameters.__pydantic_extra__.items():
        try:
            base, kinds = settings.sensor or name, _kinds(name, settings, all_sensors)
            configured |= {(kind, base) for kind in kinds}
            if settings.enabled:
                chosen.append((_build(host.model, name, base, kinds, settings, sources_by_name), settings))
        except (PluginError, UnknownName) as error:
            errors.append(str(error))
    if errors:
        raise PluginError("; ".join(errors))
    found, incomplete = discovered(sources_by_name, parameters.discover)
    if messages := [message for key, message in incomplete.items() if key not in configured]:
        host.logger.warning("not published: %s", "; ".join(messages))
    return chosen + [(own, SensorParameters()) for own in found if (own.kind, own.name) not in configured]


def _kinds(name: str, settings: SensorParameters, all_sensors: list[Sensor]) -> list[KindName]:
    """Returns the possible kinds of a configured sensor.

    Raises:
        UnknownName: Neither the model nor the configuration determines the kind.
    """
    if settings.type is not None:
        return [settings.type]
    base = settings.sensor or name
    if kinds := [sensor.kind for sensor in all_sensors if sensor.name == base]:
        return kinds
    given = settings.model_fields_set & OWN_OPTIONS
    if given and (possible := [kind for kind in KINDS if given <= options_of(kind)]):
        return possible
    raise UnknownName("sensor", base, (sensor.name for sensor in all_sensors))


def _build(
    model: mujoco.MjModel,
    name: str,
    base: str,
    kinds: list[KindName],
    settings: SensorParameters,
    sources_by_name: Mapping[str, Source],
) -> Sensor:
    """Builds a configured sensor.

    Raises:
        PluginError: The kind is ambiguous, a part is missing, or a parameter belongs to another kind.
    """
    if len(kinds) > 1:
        raise PluginError(f"sensor {name!r} can be {' or '.join(kinds)}; set its `type`")
    (kind,) = kinds
    if foreign := sorted(settings.model_fields_set & OWN_OPTIONS - options_of(kind)):
        raise PluginError(f"sensor {name!r} has type {kind}, which has no parameter {', '.join(foreign)}")
    if not KINDS[kind].composed:
        return assemble(name, kind, {"sensor": base}, sources_by_name)
    names = {}
    for part in KINDS[kind].parts:
        given: str | None = getattr(settings, part.role)
        candidates = [f"{base}_{ending}" for ending in part.endings]
        usual = next((candidate for candidate in candidates if candidate in sources_by_name), candidates[0])
        if given is not None or not part.optional or usual in sources_by_name:
            names[part.role] = given if given is not None else usual
    return assemble(name, kind, names, sources_by_name)
