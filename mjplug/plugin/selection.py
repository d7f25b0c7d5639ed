"""From the configuration's plugin entries to classes with validated parameters; all mistakes at once."""

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
from mjplug.plugin.plugin import Parameters, Plugin

Classes = Mapping[str, type[Plugin[Any]]]
"""Plugin classes by the `type` under which a configuration refers to them."""


@dataclass(frozen=True, slots=True)
class Selected:
    """One plugin instance to run; relative file names in its parameters count from the folders, first choice first."""

    name: str
    plugin_class: type[Plugin[Any]]
    parameters: Parameters
    folders: tuple[Path, ...] = ()


def select(draft: Draft, classes: Classes = MappingProxyType({})) -> tuple[Loaded, list[Selected]]:
    """Checks the plugin entries and returns the finished configuration with what it wants to run, in its order.

    The folder of the configuration file may hold modules for `module:Class` types. While such a plugin runs, the folder
    must be `importable`.

    Args:
        draft: The configuration.
        classes: Plugin classes that need not be imported, by the type that the entries give.

    Raises:
        ConfigError: Anything is wrong with the configuration, unknown plugin types and wrong parameters included.
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
