"""Finds model files: paths, `package://pkg/path`, `bundled:NAME`."""

import os
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path

from mjplug.errors import ModelError, did_you_mean
from mjplug.model.packages import Packages

SUFFIXES = (".xml", ".mjcf", ".urdf", ".xacro", ".mjb", ".mjz")
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
    if uri.startswith("topic:"):
        raise ModelError(
            f"{uri}: only `mjplug serve`, `mjplug convert` and `open_server` wait for a model from a topic"
        )
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


def locate_in_package(uri: str, environ: Mapping[str, str], around: Path | None = None) -> Path:
    """Returns the file of a `package://pkg/path` URI, without ROS's own tools.

    Args:
        uri: The URI. Some files contain three slashes, `package:///pkg/path`, with the same meaning.
        environ: Environment variables, `AMENT_PREFIX_PATH` and `ROS_PACKAGE_PATH`.
        around: Folder of the file that contains the URI; packages around it are searched last.

    Raises:
        ModelError: There is no such file; the message lists the searched folders.
    """
    return file_in_package(uri, Packages(environ, around))


def file_in_package(uri: str, packages: Packages) -> Path:
    """Returns the file of a `package://pkg/path` URI.

    Raises:
        ModelError: There is no such package, or no such file in it.
    """
    package, _, rest = uri.removeprefix(PACKAGE).lstrip("/").partition("/")
    file = packages.file(package, rest)
    if file is not None:
        return file
    listing = ", ".join(str(folder) for folder in dict.fromkeys(packages.folders(package)))
    if listing:
        raise ModelError(f"{uri!r}: package {package!r} in {listing} contains no file {rest!r}")
    raise ModelError(f"{uri!r}: there is no package {package!r} in {packages.searched()}")


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


def _models_in(folder: Path) -> list[Path]:
    if not os.access(folder, os.R_OK | os.X_OK):
        return []
    return [file for file in folder.iterdir() if file.suffix.lower() in SUFFIXES]
