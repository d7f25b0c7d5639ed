"""The arguments of `mjplug.open_server` as settings."""

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from mjplug.config.load import Draft, Setting, read
from mjplug.config.problem import ConfigError, Mark, Problem, Source
from mjplug.plugin.plugin import Plugin
from mjplug.plugin.selection import Classes
from mjplug.server.drafts import read_draft

ConfigSource = str | os.PathLike[str] | Mapping[str, Any]
"""A configuration file, a ROS parameter file, a model, or what a configuration file contains as a mapping."""

PluginEntries = Mapping[str, str | type[Plugin[Any]] | Mapping[str, Any]]
"""Plugin instances by name: the type, or the type and the parameters as in a configuration file."""

ANY_PORT = "tcp/127.0.0.1:0"

_NETWORK = ("mode", "listen", "connect", "config")


def draft_of(
    config: ConfigSource,
    *,
    model: str | os.PathLike[str] | None,
    plugins: PluginEntries | Iterable[str],
    paused: bool | None,
    speed: float | Literal["max"] | None,
    keyframe: str | int | None,
    listen: str | Sequence[str] | None,
    connect: str | Sequence[str] | None,
    zenoh_config: str | os.PathLike[str] | None,
    settings: Mapping[str, object],
    environ: Mapping[str, str],
) -> tuple[Draft, Classes]:
    """Returns the configuration that the arguments of `open_server` describe, and the plugin classes among them.

    If neither the configuration nor an argument sets the network, the server listens on a free port of 127.0.0.1.

    Raises:
        ConfigError: The configuration cannot be read.
    """
    classes: dict[str, type[Plugin[Any]]] = {}
    given = [*_plugin_settings(plugins, classes)]
    given += [Setting(f"settings[{name!r}]={value!r}", name, value) for name, value in settings.items()]
    named = {
        "sim.paused": ("paused", paused),
        "sim.speed": ("speed", speed),
        "sim.keyframe": ("keyframe", keyframe),
        "zenoh.listen": ("listen", [listen] if isinstance(listen, str) else listen),
        "zenoh.connect": ("connect", [connect] if isinstance(connect, str) else connect),
        # Absolute, because a relative path in the configuration is relative to the folder of its file.
        "zenoh.config": ("zenoh_config", None if zenoh_config is None else str(Path(zenoh_config).absolute())),
    }
    given += [
        Setting(f"{argument}={value!r}", name, value) for name, (argument, value) in named.items() if value is not None
    ]
    path: str | Path | Mapping[str, Any] = config if isinstance(config, str | Mapping) else Path(config)
    uri = None if model is None else os.fspath(model)
    plain = read(path, model=uri, sets=given, environ=environ)
    if all(plain.origin(("zenoh", part)) is None for part in _NETWORK):
        given.append(Setting("default", "zenoh.listen", [ANY_PORT]))
    return read_draft(path, model=uri, sets=given, environ=environ), classes


def _plugin_settings(
    plugins: PluginEntries | Iterable[str], classes: dict[str, type[Plugin[Any]]]
) -> Iterable[Setting]:
    """Yields the settings that add plugins; a class gets a name in `classes` that refers to it."""
    if isinstance(plugins, str):
        plugins = [plugins]
    if not isinstance(plugins, Mapping):
        # An instance is named after its type, as with `--plugin`.
        kinds = [*plugins]
        if any(not isinstance(kind, str) for kind in kinds):
            source = Source(f"plugins={kinds!r}")
            raise ConfigError(
                [Problem("a list contains types as text; give a class a name: {NAME: CLASS}", Mark(source))]
            )
        plugins = {kind.replace(":", "/").rpartition("/")[2]: kind for kind in kinds}
        if len(plugins) < len(kinds):
            source = Source(f"plugins={kinds!r}")
            raise ConfigError(
                [Problem("two plugins have the same name; give each one a name: {NAME: TYPE}", Mark(source))]
            )
    for name, entry in plugins.items():
        if "." in name:
            source = Source(f"plugins={{{name!r}: ...}}")
            raise ConfigError([Problem("a plugin instance's name consists of letters, digits and _", Mark(source))])
        parameters = dict(entry) if isinstance(entry, Mapping) else {"type": entry}
        kind = parameters.get("type")
        if isinstance(kind, type):
            name_of_type = f"{kind.__module__}:{kind.__qualname__}"
            classes[name_of_type] = kind
            parameters["type"] = name_of_type
        yield Setting(f"plugins={{{name!r}: {entry!r}}}", f"plugins.{name}", parameters)
