"""A configuration between reading and running: what it says, where, and what is wrong with it."""

from collections.abc import Iterable
from pathlib import Path

from pydantic import ValidationError

from mjplug.config.origins import Origins
from mjplug.config.problem import ConfigError, Problem
from mjplug.config.settings import PluginEntry, Settings
from mjplug.config.tree import Tree


class Loaded(Origins):
    """A valid configuration, and where each part of it came from.

    Attributes:
        settings: The values.
        warnings: What the user should hear, though nothing is wrong with it.
    """

    settings: Settings
    warnings: tuple[Problem, ...]

    def __init__(self, tree: Tree, folder: Path, settings: Settings, warnings: Iterable[Problem]) -> None:
        super().__init__(tree, folder)
        self.settings = settings
        self.warnings = tuple(warnings)


class Draft(Origins):
    """A configuration that was read, and may still be wrong.

    Who knows the plugins checks their parameters on a draft, so that what is wrong with them comes out together with
    the rest.

    Attributes:
        problems: What is wrong so far, warnings included.
    """

    def __init__(self, tree: Tree, folder: Path, problems: Iterable[Problem]) -> None:
        super().__init__(tree, folder)
        self.problems = list(problems)
        self._settings: Settings | None = None
        try:
            # That the model is missing has been said already, in better words.
            self._settings = Settings.model_validate({"model": "?", **tree.value})
        except ValidationError as error:
            self.problems += self.explain(error, (), Settings)
        self.problems += self.missing_file(("zenoh", "config"))
        libraries = self._tree.get(("sim", "plugin_libraries"))
        for i in range(len(libraries) if isinstance(libraries, list) else 0):
            self.problems += self.missing_file(("sim", "plugin_libraries", i))
        if self._tree.get(("sim", "start_position_file")):
            self.problems += self.missing_file(("sim", "start_position_file"))

    @property
    def plugins(self) -> dict[str, PluginEntry]:
        """The plugin entries that have a type, by instance name, even where other settings are wrong.

        They have the type and the plugin's own parameters only.
        """
        found = self._tree.value.get("plugins")
        entries = found if isinstance(found, dict) else {}
        # Without the server's own keys, which are checked with the other settings and may be wrong.
        own = PluginEntry.model_fields.keys() - {"type"}
        return {
            name: PluginEntry.model_validate({key: value for key, value in entry.items() if key not in own})
            for name, entry in entries.items()
            if isinstance(entry, dict) and isinstance(entry.get("type"), str) and entry["type"]
        }

    def finish(self, more: Iterable[Problem] = ()) -> Loaded:
        """Returns the configuration if nothing is wrong with it.

        Args:
            more: What plugins have found.

        Raises:
            ConfigError: Something is wrong; all of it is in there.
        """
        problems = _in_order([*self.problems, *more])
        if self._settings is None or any(problem.severity == "error" for problem in problems):
            raise ConfigError(problems)
        return Loaded(self._tree, self.folder, self._settings, problems)


def _in_order(problems: list[Problem]) -> list[Problem]:
    """Returns problems as a reader goes through the files, each of them once."""
    sources = list(dict.fromkeys(problem.mark.source.name for problem in problems))
    return sorted(
        dict.fromkeys(problems),
        key=lambda problem: (sources.index(problem.mark.source.name), problem.mark.line, problem.mark.column),
    )
