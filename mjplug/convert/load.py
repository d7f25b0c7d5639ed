"""Loads a model; a URDF or xacro file is converted first, unless the cache contains the result."""

import json
import logging
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from mjplug.convert.options import ConversionOptions
from mjplug.convert.report import RECORD, Report, report_of
from mjplug.errors import ModelError
from mjplug.model.file import LoadedModel
from mjplug.model.file import load_model as load_file
from mjplug.model.location import locate
from mjplug.model.packages import Packages

if TYPE_CHECKING:
    from mjplug.convert.conversion import Conversion
    from mjplug.convert.received import ReceivedModel
    from mjplug.convert.source import Source

DESCRIPTIONS = (".urdf", ".xacro")
"""Suffixes of robot descriptions."""

Progress = Callable[[str, float], None]

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class ConvertedRobot:
    """A converted robot in the cache.

    Attributes:
        source: The URDF or xacro file.
        folder: The folder with `scene.xml`, `robot.urdf` and `mjplug.yaml`.
    """

    source: Path
    folder: Path

    def load(self) -> LoadedModel:
        """Compiles the scene."""
        loaded = load_file(str(self.folder / "scene.xml"))
        return replace(
            loaded, path=self.source, compiled=loaded.path, description=self.folder / "robot.urdf", keyframe="home"
        )

    def report(self) -> Report:
        """Returns the report of the conversion, also of an earlier one."""
        record = json.loads((self.folder / RECORD).read_text(encoding="utf-8"))
        return report_of(record["notes"])

    def plugins(self) -> dict[str, Any]:
        """Returns the plugin instances that fit the robot, as in a configuration file."""
        content = yaml.safe_load((self.folder / "mjplug.yaml").read_text(encoding="utf-8"))
        plugins: dict[str, Any] = content["plugins"]
        if "robot_description" in plugins:
            plugins["robot_description"]["file"] = str(self.folder / "robot.urdf")
        return plugins


def is_description(uri: str | os.PathLike[str]) -> bool:
    """Returns whether a name is that of a robot description, which is converted."""
    return os.fspath(uri).lower().endswith(DESCRIPTIONS)


def load_model(
    uri: str,
    *folders: Path,
    options: ConversionOptions | None = None,
    environ: Mapping[str, str] = os.environ,
    progress: Progress = lambda stage, part: None,
    done: "Callable[[ConvertedRobot], None]" = lambda robot: None,
) -> LoadedModel:
    """Finds, converts and compiles a model.

    Args:
        uri: A path, `package://pkg/path` or `bundled:NAME`.
        folders: Folders in which a relative path is searched, in this order; then the current folder is searched.
        options: Options for a URDF or xacro file; `scene` also for MJCF files.
        environ: Environment variables for the search of ROS packages, and for the place of the cache.
        progress: Is called while a robot is converted.
        done: Gets the robot if it was converted now or earlier.

    Raises:
        ModelError: The model does not exist, or cannot be converted or compiled.
    """
    robot = converted_robot(uri, *folders, options=options, environ=environ, progress=progress)
    if robot is not None:
        done(robot)
        return robot.load()
    _warn_of_unused(uri, options or ConversionOptions())
    if options is None or options.raw or not options.scene or is_description(uri):
        return load_file(uri, *folders, environ=environ)
    # Imported here, because most models need no scene.
    from mjplug.convert.mjcf_scene import model_in_scene  # noqa: PLC0415

    path = locate(uri, folders, environ)
    alone = load_file(str(path))
    return replace(alone, model=model_in_scene(path, options.scene))


def _warn_of_unused(uri: str, options: ConversionOptions) -> None:
    """Logs the options that have no effect on a model that is not converted."""
    used = {"raw", "packages"} | (set() if options.raw or is_description(uri) else {"scene"})
    unused = sorted(options.model_dump(exclude_defaults=True).keys() - used)
    if unused:
        _log.warning(
            "%s is not converted, so these model_options have no effect: %s%s",
            uri,
            ", ".join(unused),
            "" if options.raw or not is_description(uri) else " (MuJoCo reads it itself, because it contains <mujoco>)",
        )


def converted_robot(
    uri: str,
    *folders: Path,
    options: ConversionOptions | None = None,
    environ: Mapping[str, str] = os.environ,
    progress: Progress = lambda stage, part: None,
) -> ConvertedRobot | None:
    """Returns the converted robot, from the cache if possible; None if MuJoCo reads the file itself.

    MuJoCo reads a URDF itself with the option `raw`, or if it contains a `<mujoco>` element for MuJoCo's reader.

    Raises:
        ModelError: The file does not exist, or cannot be converted.
    """
    options = options or ConversionOptions()
    if options.raw or not is_description(uri):
        return None
    # Imported here, because most models need no conversion.
    from mjplug.convert.source import read_source  # noqa: PLC0415

    path = locate(uri, folders, environ)
    if path.is_dir():
        raise ModelError(f"{path} is a directory, not a robot description")
    packages = packages_for(path, options, environ)
    source = read_source(path, options.arguments, packages)
    if source.root.find("mujoco") is not None and path.suffix.lower() == ".urdf":
        return None
    return _converted(source, options, packages, environ, progress)


def load_received(
    model: "ReceivedModel",
    options: ConversionOptions,
    environ: Mapping[str, str] = os.environ,
    progress: Progress = lambda stage, part: None,
    done: "Callable[[ConvertedRobot], None]" = lambda robot: None,
) -> LoadedModel:
    """Converts and compiles a model from a topic.

    Raises:
        ModelError: It cannot be converted or compiled, or names files that it must not read.
    """
    from mjplug.convert.received import check_received  # noqa: PLC0415

    if model.is_description:
        robot = converted_received(model, options, environ, progress)
        done(robot)
        return robot.load()
    check_received(model, received_packages(options, environ))
    return load_model(str(model.path), options=options, environ=environ)


def converted_received(
    model: "ReceivedModel",
    options: ConversionOptions,
    environ: Mapping[str, str] = os.environ,
    progress: Progress = lambda stage, part: None,
) -> ConvertedRobot:
    """Returns a converted robot from a topic, from the cache if possible.

    Raises:
        ModelError: It cannot be converted.
    """
    from mjplug.convert.received import read_received  # noqa: PLC0415

    if options.raw:
        raise ModelError(f"the URDF on {model.topic} is always converted; do not set the option raw")
    packages = received_packages(options, environ)
    return _converted(read_received(model, options.arguments, packages), options, packages, environ, progress)


def received_packages(options: ConversionOptions, environ: Mapping[str, str]) -> Packages:
    """Returns the packages that a robot from a topic can name; none is searched around a file.

    Raises:
        ModelError: A folder in the options does not exist.
    """
    return Packages(environ, None, _given(options))


def _converted(
    source: "Source",
    options: ConversionOptions,
    packages: Packages,
    environ: Mapping[str, str],
    progress: Progress,
) -> ConvertedRobot:
    from mjplug.convert.cache import cache_folder, cached  # noqa: PLC0415
    from mjplug.convert.conversion import convert  # noqa: PLC0415

    def run() -> "Conversion":
        return convert(source, options, packages, cache_folder(environ) / "parts", progress)

    return ConvertedRobot(source.path, cached(source, options, packages, run, environ))


def packages_for(path: Path, options: ConversionOptions, environ: Mapping[str, str]) -> Packages:
    """Returns the packages that a robot can name.

    Raises:
        ModelError: A folder in the options does not exist.
    """
    return Packages(environ, path.absolute().parent, _given(options))


def _given(options: ConversionOptions) -> dict[str, Path]:
    given = {name: Path(os.path.expanduser(folder)) for name, folder in options.packages.items()}
    for name, folder in given.items():
        if not folder.is_dir():
            raise ModelError(f"the folder of package {name!r} is {str(folder)!r}, which does not exist")
    return given
