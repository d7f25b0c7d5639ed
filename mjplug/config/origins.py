"""The places of a configuration's values: for error messages, and for the folders of relative file names."""

import os
from pathlib import Path

from pydantic import BaseModel, ValidationError

from mjplug.config.document import KeyPath
from mjplug.config.explain import dotted, explain
from mjplug.config.problem import Mark, Problem
from mjplug.config.tree import Tree


class Origins:
    """The places of a configuration's values.

    Paths are tuples such as `("plugins", "hb", "update_rate")`.

    Attributes:
        folder: The folder of the main file; without a file, the current folder.

    Args:
        tree: The values with their places.
        folder: See the attribute.
    """

    def __init__(self, tree: Tree, folder: Path) -> None:
        self.folder = folder
        self._tree = tree

    def explain(
        self, error: ValidationError, prefix: KeyPath = (), model: type[BaseModel] | None = None
    ) -> list[Problem]:
        """Converts a validation error to problems with a place.

        Args:
            error: The validation error.
            prefix: The path of the validated mapping, such as `("plugins", "hb")`.
            model: The model of the validation; if given, messages about unknown keys list and suggest known keys.
        """
        return explain(error, self._tree, prefix, model)

    def problem(self, path: KeyPath, message: str, hint: str = "") -> Problem:
        """Returns a problem at the place of a value; if there is no such value, at the place of its section."""
        return Problem(f"{dotted(path)}: {message}" if path else message, self._tree.place(path).value, hint)

    def origin(self, path: KeyPath) -> Mark | None:
        """Returns the place of the value at a path; None if the value is a default."""
        return None if self._tree.get(path) is None else self._tree.place(path).value

    def folders(self, path: KeyPath) -> tuple[Path, ...]:
        """Returns the folders in which a relative file name at a path is searched, in this order.

        For a name in a file, they are the file's folder, then the current folder. For command line options and
        environment variables, they are the current folder, then the main file's folder.
        """
        folder = self._tree.place(path).value.source.folder
        choices = (folder, Path.cwd()) if folder is not None else (Path.cwd(), self.folder)
        return tuple(dict.fromkeys(choices))

    def path(self, path: KeyPath) -> Path | None:
        """Returns the file named by the value at a path, such as `("zenoh", "config")`; None if it does not exist."""
        name = self._tree.get(path)
        if not isinstance(name, str):
            return None
        # os.path returns False where pathlib raises: for unreadable folders, unknown users and too long names.
        candidates = (folder / os.path.expanduser(name) for folder in self.folders(path))
        return next((Path(file) for file in candidates if os.path.isfile(file)), None)

    def missing_file(self, path: KeyPath) -> list[Problem]:
        """Returns a problem if the value at a path names a file that does not exist."""
        name = self._tree.get(path)
        if not isinstance(name, str) or self.path(path) is not None:
            return []
        folders = " or ".join(str(folder) for folder in self.folders(path))
        return [self.problem(path, f"there is no file {name!r} in {folders}")]
