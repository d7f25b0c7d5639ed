"""From the configuration's plugin entries to classes with validated parameters; all mistakes at once."""

import sys
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from mjplug.config.load import Loaded
from mjplug.config.problem import Problem
from mjplug.errors import ConfigError, PluginError, UnknownName
from mjplug.plugin import registry
from mjplug.plugin.plugin import Parameters, Plugin


@dataclass(frozen=True, slots=True)
class Selected:
    """One plugin instance to run."""

    name: str
    plugin_class: type[Plugin[Any]]
    parameters: Parameters


def select(loaded: Loaded) -> list[Selected]:
    """Returns what the configuration wants to run, in its order.

    The folder of the configuration file may hold modules for `module:Class` types.

    Raises:
        ConfigError: Unknown types or wrong parameters, all of them.
    """
    if str(loaded.folder) not in sys.path:
        sys.path.append(str(loaded.folder))
    selected: list[Selected] = []
    problems: list[Problem] = []
    for name, entry in loaded.settings.plugins.items():
        try:
            plugin_class = registry.find(entry.type)
            parameters = plugin_class.parameters_type.model_validate(entry.parameters)
        except (UnknownName, PluginError) as error:
            problems.append(loaded.problem(("plugins", name, "type"), str(error)))
        except ValidationError as error:
            problems += loaded.explain(error, ("plugins", name))
        else:
            selected.append(Selected(name, plugin_class, parameters))
    if problems:
        raise ConfigError(problems)
    return selected
