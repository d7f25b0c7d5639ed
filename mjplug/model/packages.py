"""Finds ROS packages without ROS: by environment variables, and by the `package.xml` files around a robot."""

import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType

MANIFEST = "package.xml"

_PARENTS, _DEPTH, _MAX_FOLDERS = 4, 3, 5000
"""How many folders above the robot are searched, how deep, and how many folders are opened at most."""

_NAME = re.compile(rb"<name>\s*([\w.-]+)\s*</name>")
_SKIPPED = frozenset({"node_modules", "__pycache__", "build", "log"})


def declared_name(folder: Path) -> str | None:
    """Returns the name in the folder's `package.xml`; None if there is no such file or name."""
    try:
        with (folder / MANIFEST).open("rb") as file:
            found = _NAME.search(file.read(65536))
    except OSError:
        return None
    return found[1].decode() if found else None


class Packages:
    """The ROS packages that a robot can name.

    A package is found, in this order: as given; in `<prefix>/share/<name>` for the prefixes in `AMENT_PREFIX_PATH`; in
    the folders of `ROS_PACKAGE_PATH`; in a folder around the robot with this name, or whose `package.xml` contains it;
    among the packages up to three levels below the four nearest folders around the robot.

    Args:
        environ: Environment variables.
        around: The folder of the robot; None for no search around it.
        given: Folders of packages by name.
    """

    def __init__(
        self,
        environ: Mapping[str, str] = os.environ,
        around: Path | None = None,
        given: Mapping[str, Path] = MappingProxyType({}),
    ) -> None:
        self._prefixes = _paths(environ, "AMENT_PREFIX_PATH")
        self._ros_paths = _paths(environ, "ROS_PACKAGE_PATH")
        self._around = None if around is None else around.absolute()
        self._given = dict(given)
        self._nearby: dict[str, list[Path]] | None = None
        self._below: dict[Path, dict[str, list[Path]]] = {}

    def folders(self, name: str) -> Iterator[Path]:
        """Yields the existing folders of a package, the first choice first; one may appear twice."""
        if name in self._given:
            yield self._given[name]
            return
        for folder in self._candidates(name):
            if folder.is_dir():
                yield folder
        for root in self._ros_paths:
            yield from self._packages_below(root).get(name, ())
        yield from self._near().get(name, ())

    def file(self, name: str, path: str) -> Path | None:
        """Returns a file of a package, or None."""
        return next((folder / path for folder in self.folders(name) if (folder / path).is_file()), None)

    def of(self, file: Path) -> tuple[str, str] | None:
        """Returns the package that contains a file, and the path inside it; None if it is in no package."""
        for folder in file.parents:
            name = declared_name(folder)
            if name is not None:
                return name, file.relative_to(folder).as_posix()
        return None

    def contain(self, file: Path) -> bool:
        """Returns whether an absolute path without `..` is in a package, or in a given folder."""
        given = [Path(os.path.normpath(folder.absolute())) for folder in self._given.values()]
        return any(folder in (file, *file.parents) for folder in given) or self.of(file / "_") is not None

    def searched(self) -> str:
        """Returns a description of the searched places, for error messages."""
        around = "" if self._around is None else ", nor in a folder around the URDF"
        return f"AMENT_PREFIX_PATH or ROS_PACKAGE_PATH{around}"

    def _candidates(self, name: str) -> Iterator[Path]:
        for prefix in self._prefixes:
            yield prefix / "share" / name
        for root in self._ros_paths:
            yield from _roots(root, name)
        for folder in () if self._around is None else (self._around, *self._around.parents):
            yield from _roots(folder, name)

    def _near(self) -> dict[str, list[Path]]:
        if self._nearby is None:
            self._nearby = {}
            if self._around is not None:
                above = [self._around, *self._around.parents]
                for folder in above:
                    name = declared_name(folder)
                    if name is not None:
                        self._nearby.setdefault(name, []).append(folder)
                for folder in above[: _PARENTS + 1]:
                    if folder in (Path.home(), Path(folder.anchor)):
                        break
                    for name, found in self._packages_below(folder).items():
                        self._nearby.setdefault(name, []).extend(found)
        return self._nearby

    def _packages_below(self, root: Path) -> dict[str, list[Path]]:
        if root not in self._below:
            found: dict[str, list[Path]] = {}
            budget = [_MAX_FOLDERS]
            for folder in _manifests(root, _DEPTH, budget):
                name = declared_name(folder)
                if name is not None:
                    found.setdefault(name, []).append(folder)
            self._below[root] = found
        return self._below[root]


def _manifests(folder: Path, depth: int, budget: list[int]) -> Iterator[Path]:
    """Yields the folders with a `package.xml`, in the order of their names; a package contains no other package."""
    budget[0] -= 1
    try:
        inside = sorted(os.scandir(folder), key=lambda entry: entry.name)
    except OSError:
        return
    if any(entry.name == MANIFEST for entry in inside):
        yield folder
        return
    for entry in inside:
        if depth and budget[0] > 0 and not entry.name.startswith(".") and entry.name not in _SKIPPED:
            try:
                is_folder = entry.is_dir()
            except OSError:
                continue
            if is_folder:
                yield from _manifests(Path(entry.path), depth - 1, budget)


def _roots(folder: Path, name: str) -> list[Path]:
    return [folder, folder / name] if folder.name == name else [folder / name]


def _paths(environ: Mapping[str, str], variable: str) -> list[Path]:
    return [Path(path) for path in environ.get(variable, "").split(os.pathsep) if path]
