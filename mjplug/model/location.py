"""Finds model files: paths, `package://pkg/path`, `bundled:NAME`."""

import os
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path

from mjplug.errors import ModelError, did_you_mean

SUFFIXES = (".xml", ".mjcf", ".urdf", ".mjb", ".mjz")
"""Suffixes of model files."""

PACKAGE = "package://"
BUNDLED = "bundled:"


def locate(uri: str, folders: Sequence[Path] = (), environ: Mapping[str, str] = os.environ) -> Path:
    """Returns the path of a model.

    Args:
        uri: A path, `package://pkg/path` or `bundled:NAME`.
        folders: Folders in which a relative path is searched, in this order; then the current folder is searched.
        environ: Environment variables; `AMENT_PREFIX_PATH` and `ROS_PACKAGE_PATH` are used.

    Raises:
        ModelError: There is no such file; the message lists the searched folders.
    """
    if uri.startswith(BUNDLED):
        return _bundled(uri.removeprefix(BUNDLED))
    if uri.startswith(PACKAGE):
        return locate_in_package(uri, environ)
    path = Path(os.path.expanduser(uri))
    candidates = [path] if path.is_absolute() else [folder / path for folder in dict.fromkeys([*folders, Path.cwd()])]
    for candidate in candidates:
        if os.path.exists(candidate):
            return candidate
    siblings = {
        file.name
        for candidate in candidates
        if os.path.isdir(candidate.parent)
        for file in _models_in(candidate.parent)
    }
    where = " or ".join(str(candidate.parent) for candidate in candidates)
    raise ModelError(f"there is no model {path.name!r} in {where}{did_you_mean(path.name, sorted(siblings))}")


def locate_in_package(uri: str, environ: Mapping[str, str], more: Sequence[Path] = ()) -> Path:
    """Returns the file of a `package://pkg/path` URI, without ROS's own tools.

    Args:
        uri: The URI.
        environ: Environment variables. `<prefix>/share/<pkg>` is searched for each prefix in `AMENT_PREFIX_PATH`, then
            `<folder>/<pkg>` for each folder in `ROS_PACKAGE_PATH`.
        more: Folders that may be or contain the package; they are searched last.

    Raises:
        ModelError: There is no such file; the message lists the searched folders.
    """
    package, _, rest = uri.removeprefix(PACKAGE).partition("/")
    installed = [prefix / "share" / package for prefix in _paths(environ, "AMENT_PREFIX_PATH")]
    around = [root for folder in [*_paths(environ, "ROS_PACKAGE_PATH"), *more] for root in _roots(folder, package)]
    tried = list(dict.fromkeys([*installed, *around]))
    for folder in tried:
        if (folder / rest).is_file():
            return folder / rest
    listing = ", ".join(str(folder) for folder in tried if folder.is_dir())
    if listing:
        raise ModelError(f"{uri!r}: package {package!r} in {listing} contains no file {rest!r}")
    raise ModelError(f"{uri!r}: there is no package {package!r} in AMENT_PREFIX_PATH or ROS_PACKAGE_PATH")


def bundled_models() -> list[str]:
    """Returns the names of the models that are included in mjplug."""
    folder = _bundle()
    files = [file.stem for file in folder.glob("*.xml")]
    return sorted([*files, *(file.parent.name for file in folder.glob("*/scene.xml"))])


def _bundled(name: str) -> Path:
    known = bundled_models()
    if name not in known:
        listing = f"known: {', '.join(known)}" if known else "there is none"
        raise ModelError(f"unknown bundled model {name!r}{did_you_mean(name, known)}; {listing}")
    file = _bundle() / f"{name}.xml"
    return file if file.is_file() else _bundle() / name / "scene.xml"


def _bundle() -> Path:
    # MuJoCo reads included files and meshes by path, so the package must be installed as files, as pip does.
    return Path(str(resources.files("mjplug") / "bundled"))


def _roots(folder: Path, package: str) -> list[Path]:
    return [folder, folder / package] if folder.name == package else [folder / package]


def _models_in(folder: Path) -> list[Path]:
    if not os.access(folder, os.R_OK | os.X_OK):
        return []
    return [file for file in folder.iterdir() if file.suffix.lower() in SUFFIXES]


def _paths(environ: Mapping[str, str], variable: str) -> list[Path]:
    return [Path(path) for path in environ.get(variable, "").split(os.pathsep) if path]
