"""Finds plugin classes by the names configuration files use: entry points, or `module:Class`."""

from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from mjplug.errors import PluginError, UnknownName
from mjplug.plugin.folder_modules import import_plugin_module
from mjplug.plugin.plugin import Plugin

GROUP = "mjplug.plugins"
"""The entry point group in which packages register plugins, under as many names as they like."""


def registered() -> dict[str, EntryPoint]:
    """Returns every registered plugin name with its entry point; nothing is imported."""
    return {point.name: point for point in sorted(entry_points(group=GROUP), key=lambda p: p.name)}


def find(type_name: str, folder: Path | None = None) -> type[Plugin[Any]]:
    """Returns the plugin class of a name: `heartbeat`, `mujoco_ros2_control_plugins/CameraPlugin`, `module:Class`.

    Args:
        type_name: The name.
        folder: The folder of the configuration that it stands in, which is `importable`; None if there is none.

    Raises:
        UnknownName: No such plugin is registered.
        PluginError: It cannot be imported, or is no plugin.
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
        # Whatever a foreign module does wrong, the user must hear which plugin it is.
        raise PluginError(
            f"plugin {type_name!r}: cannot import {module_name!r}: {type(error).__name__}: {error}"
        ) from error
    found = getattr(module, class_name, None)
    if found is None:
        raise PluginError(f"plugin {type_name!r}: module {module_name!r} has no {class_name!r}")
    if not (isinstance(found, type) and issubclass(found, Plugin)):
        raise PluginError(f"plugin {type_name!r}: {target} is not a subclass of mjplug.plugin.Plugin")
    return found
