"""Puts a configuration together: defaults, files, environment, command line; everything wrong comes out at once."""

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from pydantic import ValidationError

from mjplug.config import overrides
from mjplug.config.document import Document, KeyPath, read_document
from mjplug.config.origins import Origins
from mjplug.config.problem import Mark, Problem, Source
from mjplug.config.ros_params import is_ros_file, node_names, own_form
from mjplug.config.settings import PluginEntry, Settings
from mjplug.config.tree import Tree
from mjplug.errors import ConfigError

_MODEL_SUFFIXES = (".xml", ".mjcf", ".urdf", ".mjb", ".mjz")
_MODEL_SCHEMES = ("bundled:", "package://")


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

    Who knows the plugins checks their parameters on a draft, so that what is wrong with them comes out together with the rest.

    Attributes:
        problems: What is wrong so far, warnings included.
    """

    def __init__(self, tree: Tree, folder: Path, problems: Iterable[Problem]) -> None:
        super().__init__(tree, folder)
        self.problems = list(problems)
        self._settings: Settings | None = None
        try:
            self._settings = Settings.model_validate(tree.value)
        except ValidationError as error:
            self.problems += self.explain(error, (), Settings)
        self._find(("zenoh", "config"))

    @property
    def plugins(self) -> dict[str, PluginEntry]:
        """The plugin entries that have a type, by instance name, even where other settings are wrong."""
        found = self._tree.value.get("plugins")
        entries = found if isinstance(found, dict) else {}
        return {
            name: PluginEntry.model_validate(entry)
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
        problems = [*self.problems, *more]
        if self._settings is None or any(problem.severity == "error" for problem in problems):
            raise ConfigError(problems)
        return Loaded(self._tree, self.folder, self._settings, problems)

    def _find(self, path: KeyPath) -> Path | None:
        """Returns the file that is named at a path; if there is a name but no file, this is a problem."""
        name, file = self._tree.get(path), self.path(path)
        if isinstance(name, str) and file is None:
            looked = " or ".join(str(folder) for folder in self.folders(path))
            self.problems.append(self.problem(path, f"no such file: {name!r}, neither in {looked}" ...))
        return file
