"""Where each part of a configuration came from: for errors, and for what its relative file names count from."""

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
        folder: The folder of the main file; without a file, the current one.

    Args:
        tree: The values with their places.
        folder: As above.
    """

    def __init__(self, tree: Tree, folder: Path) -> None:
        self.folder = folder
        self._tree = tree

    def explain(
        self, error: ValidationError, prefix: KeyPath = (), model: type[BaseModel] | None = None
    ) -> list[Problem]:
        """Returns pydantic's findings as problems with a place.

        Args:
            error: What pydantic found.
            prefix: The path of the mapping that was validated, such as `("plugins", "hb")`.
            model: What it was validated with; known keys are then listed, and guessed for misspelt ones.
        """
        return explain(error, self._tree, prefix, model)

    def problem(self, path: KeyPath, message: str, hint: str = "") -> Problem:
        """Returns a problem with the value at a path; where there is none, with the section around it."""
        return Problem(f"{dotted(path)}: {message}" if path else message, self._tree.place(path).value, hint)

    def origin(self, path: KeyPath) -> Mark | None:
        """Returns where the value at a path stands; None if nobody has said it, so that it is a default."""
        return None if self._tree.get(path) is None else self._tree.place(path).value

    def folders(self, path: KeyPath) -> tuple[Path, ...]:
        """Returns where a relative file name at a path counts from, first choice first.

        For a name in a file that is the file's folder, then the current one; for options and variables the other way
        round.
        """
        folder = self._tree.place(path).value.source.folder
        choices = (folder, Path.cwd()) if folder is not None else (Path.cwd(), self.folder)
        return tuple(dict.fromkeys(choices))

    def path(self, path: KeyPath) -> Path | None:
        """Returns the file that is named at a path, such as `("zenoh", "config")`; None if it does not exist."""
        name = self._tree.get(path)
        if not isinstance(name, str):
            return None
        # os.path answers "no" where pathlib raises: for unreadable folders, unknown users, names too long.
        candidates = (folder / os.path.expanduser(name) for folder in self.folders(path))
        return next((Path(file) for file in candidates if os.path.isfile(file)), None)

    def missing_file(self, path: KeyPath) -> list[Problem]:
        """Returns a problem if a file is named at a path, and does not exist."""
        name = self._tree.get(path)
        if not isinstance(name, str) or self.path(path) is not None:
            return []
        folders = " or ".join(str(folder) for folder in self.folders(path))
        return [self.problem(path, f"there is no file {name!r} in {folders}")]
