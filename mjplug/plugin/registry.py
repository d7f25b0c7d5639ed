"""Finds plugin classes by the type names of configuration files: entry points, or `module:Class`."""

from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from mjplug.errors import PluginError, UnknownName
from mjplug.plugin.folder_modules import import_plugin_module
from mjplug.plugin.plugin import Plugin

GROUP = "mjplug.plugins"
"""The entry point group in which packages register plugins. A plugin may be registered under several names."""


def registered() -> dict[str, EntryPoint]:
    """Returns the entry point of every registered plugin by name; imports nothing."""
    return {point.name: point for point in sorted(entry_points(group=GROUP), key=lambda p: p.name)}


def find(type_name: str, folder: Path | None = None) -> type[Plugin[Any]]:
    """Returns the plugin class of a type name.

    Args:
        type_name: A registered name such as `heartbeat` or `mujoco_ros2_control_plugins/CameraPlugin`, or
            `module:Class`.
        folder: The folder of the configuration file, which must be `importable`; None if there is none.

    Raises:
        UnknownName: No plugin is registered under this name.
        PluginError: The module cannot be imported, or the class is not a plugin.
    """
    points = registered()
    if type_name in points:
        target = points[type_name].value
    elif ":" in type_name:
        target = type_name
    else:
        raise UnknownName("plugin type", type_name, points)
    module_name, _, class_name = target.partition(":")
    try:
        module = import_plugin_module(module_name, folder)
    except PluginError as error:
        raise PluginError(f"plugin {type_name!r}: {error}") from error
    except Exception as error:
        # Any exception, because the import runs code of others; the message must name the plugin.
        raise PluginError(
            f"plugin {type_name!r}: cannot import {module_name!r}: {type(error).__name__}: {error}"
        ) from error
    found = getattr(module, class_name, None)
    if found is None:
        raise PluginError(f"plugin {type_name!r}: module {module_name!r} contains no {class_name!r}")
    if not (isinstance(found, type) and issubclass(found, Plugin)):
        raise PluginError(f"plugin {type_name!r}: {target} is not a subclass of mjplug.plugin.Plugin")
    return found
