"""A configuration that was read: its values, their places, and its problems."""

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from pydantic import ValidationError

from mjplug.config.document import KeyPath
from mjplug.config.origins import Origins
from mjplug.config.problem import ConfigError, Problem
from mjplug.config.settings import PluginEntry, Settings
from mjplug.config.tree import Tree
from mjplug.convert.options import ConversionOptions
from mjplug.convert.received import ReceivedModel


class Loaded(Origins):
    """A valid configuration with the places of its values.

    Attributes:
        settings: The values.
        warnings: Problems that do not prevent a start.
    """

    settings: Settings
    warnings: tuple[Problem, ...]

    def __init__(self, tree: Tree, folder: Path, settings: Settings, warnings: Iterable[Problem]) -> None:
        super().__init__(tree, folder)
        self.settings = settings
        self.warnings = tuple(warnings)

    @property
    def states_folder(self) -> Path | None:
        """The folder of `snapshots.folder`, which need not exist; None if it is not set."""
        name = self.settings.snapshots.folder
        return self.folders(("snapshots", "folder"))[0] / os.path.expanduser(name) if name else None

    @property
    def spawnable_folders(self) -> tuple[Path, ...]:
        """The folders of `simulation_interfaces.spawnables`."""
        names = self.settings.simulation_interfaces.spawnables
        setting = ("simulation_interfaces", "spawnables")
        return tuple(
            self.folders((*setting, number))[0] / os.path.expanduser(name) for number, name in enumerate(names)
        )


class Draft(Origins):
    """A configuration that was read, but may still be invalid.

    The parameters of plugins are validated with a draft, so that their problems are reported together with all others.

    Attributes:
        problems: The problems found so far, including warnings.
        received: The model, if it comes from a topic and has been received already.
    """

    received: ReceivedModel | None = None

    def __init__(self, tree: Tree, folder: Path, problems: Iterable[Problem]) -> None:
        super().__init__(tree, folder)
        self.problems = list(problems)
        self._settings: Settings | None = None
        try:
            # `read` has already reported a missing model.
            self._settings = Settings.model_validate({"model": "?", **tree.value})
        except ValidationError as error:
            self.problems += self.explain(error, (), Settings)
        self.problems += self.missing_file(("zenoh", "config"))
        libraries = self._tree.get(("sim", "plugin_libraries"))
        for i in range(len(libraries) if isinstance(libraries, list) else 0):
            self.problems += self.missing_file(("sim", "plugin_libraries", i))
        for path in self._option_files():
            self.problems += self.missing_file(path)
        if self._tree.get(("sim", "start_position_file")):
            self.problems += self.missing_file(("sim", "start_position_file"))

    @property
    def plugins(self) -> dict[str, PluginEntry]:
        """The plugin entries that have a type, by instance name, even if other settings are invalid.

        The entries contain only the type and the plugin's own parameters.
        """
        found = self._tree.value.get("plugins")
        entries = found if isinstance(found, dict) else {}
        # Without the server's own keys, which are validated with the other settings and may be invalid.
        own = PluginEntry.model_fields.keys() - {"type"}
        return {
            name: PluginEntry.model_validate({key: value for key, value in entry.items() if key not in own})
            for name, entry in entries.items()
            if isinstance(entry, dict) and isinstance(entry.get("type"), str) and entry["type"]
        }

    @property
    def model_options(self) -> ConversionOptions:
        """The options of the conversion with absolute file names; the defaults if a setting is invalid."""
        return ConversionOptions() if self._settings is None else self._absolute(self._settings.model_options)

    def _option_files(self) -> Iterator[KeyPath]:
        """Yields the paths of the options that name files."""
        inputs = self._tree.get(("model_options", "mujoco_inputs"))
        for i in range(len(inputs) if isinstance(inputs, list) else 0):
            yield "model_options", "mujoco_inputs", i
        if self._tree.get(("model_options", "srdf")):
            yield "model_options", "srdf"

    def _absolute(self, options: ConversionOptions) -> ConversionOptions:
        section = "model_options"
        files = {path: str(file) for path in self._option_files() if (file := self.path(path)) is not None}
        changes: dict[str, object] = {}
        if (section, "srdf") in files:
            changes["srdf"] = files[section, "srdf"]
        if options.mujoco_inputs:
            names = enumerate(options.mujoco_inputs)
            changes["mujoco_inputs"] = tuple(files.get((section, "mujoco_inputs", i), name) for i, name in names)
        # Other values are names of the library.
        if (scene := self.path((section, "scene"))) is not None:
            changes["scene"] = str(scene)
        packages = {}
        for name, folder in options.packages.items():
            choices = (above / folder for above in self.folders((section, "packages", name)))
            packages[name] = str(next((choice for choice in choices if choice.is_dir()), folder))
        return options.model_copy(update={**changes, "packages": packages})

    def finish(self, more: Iterable[Problem] = ()) -> Loaded:
        """Returns the configuration if it is valid.

        Args:
            more: Problems of plugin parameters.

        Raises:
            ConfigError: The configuration is invalid; the error contains all problems.
        """
        problems = _in_order([*self.problems, *more])
        if self._settings is None or any(problem.severity == "error" for problem in problems):
            raise ConfigError(problems)
        return Loaded(self._tree, self.folder, self._settings, problems)


def _in_order(problems: list[Problem]) -> list[Problem]:
    """Returns problems without duplicates, in the order of files, lines and columns."""
    sources = list(dict.fromkeys(problem.mark.source.name for problem in problems))
    return sorted(
        dict.fromkeys(problems),
        key=lambda problem: (sources.index(problem.mark.source.name), problem.mark.line, problem.mark.column),
    )
