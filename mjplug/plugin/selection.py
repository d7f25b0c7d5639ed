"""Converts the plugin entries of a configuration to plugin classes with validated parameters."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from pydantic import ValidationError

from mjplug.config.draft import Draft, Loaded
from mjplug.config.problem import Problem
from mjplug.errors import PluginError, UnknownName
from mjplug.plugin import registry
from mjplug.plugin.folder_modules import importable
from mjplug.plugin.parameters import Parameters
from mjplug.plugin.plugin import Plugin

Classes = Mapping[str, type[Plugin[Any]]]
"""Plugin classes by the `type` under which a configuration refers to them."""


@dataclass(frozen=True, slots=True)
class Selected:
    """One plugin instance to run.

    Attributes:
        name: The instance's name.
        plugin_class: The plugin's class.
        parameters: The validated parameters.
        folders: Folders in which relative file names of the parameters are searched, in this order.
    """

    name: str
    plugin_class: type[Plugin[Any]]
    parameters: Parameters
    folders: tuple[Path, ...] = ()


def select(draft: Draft, classes: Classes = MappingProxyType({})) -> tuple[Loaded, list[Selected]]:
    """Checks the plugin entries; returns the finished configuration and its plugin instances, in the file's order.

    Modules of `module:Class` types are also searched in the folder of the configuration file. The folder must be
    `importable` while such a plugin runs.

    Args:
        draft: The configuration.
        classes: Plugin classes that are used instead of an import, by the type in the entries.

    Raises:
        ConfigError: The configuration is invalid. The message lists all problems, including unknown plugin types and
            invalid parameters.
    """
    selected: list[Selected] = []
    problems: list[Problem] = []
    for name, entry in draft.plugins.items():
        try:
            with importable(draft.folder):
                plugin_class = classes.get(entry.type) or registry.find(entry.type, draft.folder)
            parameters = plugin_class.parameters_type.model_validate(entry.parameters)
        except (UnknownName, PluginError) as error:
            problems.append(draft.problem(("plugins", name, "type"), str(error)))
        except ValidationError as error:
            problems += draft.explain(error, ("plugins", name), plugin_class.parameters_type)
        else:
            selected.append(Selected(name, plugin_class, parameters, draft.folders(("plugins", name))))
    return draft.finish(problems), selected
