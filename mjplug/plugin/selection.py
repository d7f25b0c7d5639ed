"""From the configuration's plugin entries to classes with validated parameters; all mistakes at once."""

from dataclasses import dataclass
from typing import Any

from mjplug.plugin.plugin import Parameters, Plugin


@dataclass(frozen=True, slots=True)
class Selected:
    """One plugin instance to run."""

    name: str
    plugin_class: type[Plugin[Any]]
    parameters: Parameters
