"""Loads models: MJCF, URDF, compiled (.mjb) and packed (.mjz). Compiling a model releases the GIL."""

import logging
import os
import struct
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import mujoco

from mjplug.errors import ModelError
from mjplug.model import lidar_extension, urdf
from mjplug.model.location import SUFFIXES, locate
from mjplug.model.text import check_names, message_of

_MJB_HEADER = struct.Struct("=4i")
_MJB_ID = 54321
_UNNAMED = "MuJoCo Model"

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class LoadedModel:
    """A compiled model.

    Attributes:
        model: The model.
        name: The model's own name, or the name of its file without suffix if it has none.
        path: The model's file.
        description: The URDF of a converted robot; otherwise None.
        compiled: The file that MuJoCo has read, if it is not `path`.
        keyframe: The keyframe to start from, unless the configuration names one; empty for the default pose.
    """

    model: mujoco.MjModel
    name: str
    path: Path
    description: Path | None = None
    keyframe: str = ""
    compiled: Path | None = None

    @property
    def source(self) -> Path:
        """The file that MuJoCo has read."""
        return self.compiled or self.path

    @property
    def described_by(self) -> Path:
        """The URDF of a converted robot, otherwise the model's file."""
        return self.description or self.path


def load_model(uri: str, *folders: Path, environ: Mapping[str, str] = os.environ) -> LoadedModel:
    """Finds and compiles a model.

    Args:
        uri: A path, `package://pkg/path` or `bundled:NAME`.
        folders: Folders in which a relative path is searched, in this order; then the current folder is searched.
        environ: Environment variables for the search of ROS packages.

    Raises:
        ModelError: The file does not exist or cannot be read, MuJoCo cannot compile it, or a name in it is not UTF-8.
    """
    path = locate(uri, folders, environ)
    try:
        _check(path)
        model = _compile(path, environ)
    except OSError as error:
        raise ModelError(f"{error.filename or path} cannot be read: {error.strerror}") from error
    # RuntimeError: "Caught an unknown exception!", which MuJoCo raises for some broken models.
    except (ValueError, RuntimeError, mujoco.FatalError, zipfile.BadZipFile) as error:
        lines = [line.strip() for line in message_of(error).splitlines() if line.strip()]
        raise ModelError(f"{path}: {'; '.join(lines).replace(':;', ':')}") from error
    check_names(model, path)
    name = bytes(model.names).partition(b"\0")[0].decode()
    return LoadedModel(model, path.stem if name in ("", _UNNAMED) else name, path)


def _check(path: Path) -> None:
    """Refuses files for which MuJoCo's error message would be misleading."""
    if path.is_dir():
        inside = sorted(file.name for file in path.iterdir() if file.suffix.lower() in SUFFIXES)
        raise ModelError(
            f"{path} is a directory, not a model" + (f"; it contains {', '.join(inside[:5])}" if inside else "")
        )
    suffix = path.suffix.lower()
    if suffix == ".xacro":
        raise ModelError(f"MuJoCo does not read xacro files, so {path} must be converted; do not set the option raw")
    if suffix not in SUFFIXES:
        raise ModelError(f"{path} is not a model file; the name of a model file ends with {', '.join(SUFFIXES)}")
    with path.open("rb") as file:
        start = file.read(_MJB_HEADER.size)
    if not start:
        raise ModelError(f"{path} is empty")
    if suffix == ".mjb":
        _check_mjb(path, start)


def _check_mjb(path: Path, start: bytes) -> None:
    here = int(mujoco.mj_version())
    if len(start) < _MJB_HEADER.size or _MJB_HEADER.unpack(start)[0] != _MJB_ID:
        raise ModelError(f"{path} is not a compiled MuJoCo model")
    version = _MJB_HEADER.unpack(start)[3]
    if version != here:
        raise ModelError(
            f"{path} was compiled by MuJoCo {_dotted(version)}, but MuJoCo {_dotted(here)} is installed; "
            "use the model's XML, or compile it again"
        )


def _dotted(version: int) -> str:
    return f"{version // 1_000_000}.{version // 1000 % 1000}.{version % 1000}"


def _compile(path: Path, environ: Mapping[str, str]) -> mujoco.MjModel:
    if path.suffix.lower() == ".mjz" and zipfile.is_zipfile(path):
        return _compile_archive(path)
    try:
        return _compile_as_it_is(path, environ)
    except ValueError as error:
        if lidar_extension.PLUGIN not in message_of(error):
            raise
    main = os.path.abspath(path)
    files = lidar_extension.overlay(main, lambda name: Path(name).read_bytes() if os.path.isfile(name) else None)
    return mujoco.MjModel.from_xml_path(main, files)


def _compile_as_it_is(path: Path, environ: Mapping[str, str]) -> mujoco.MjModel:
    suffix = path.suffix.lower()
    if suffix == ".mjb":
        return mujoco.MjModel.from_binary_path(str(path))
    if suffix == ".urdf":
        found = urdf.prepared(path, environ)
        if found is not None:
            model = mujoco.MjModel.from_xml_string(found.xml, found.assets)
            if found.controlled_joints and not model.nu:
                _log.warning(
                    "%s: MuJoCo does not read <ros2_control>, so the model has no actuators and these joints cannot be "
                    "commanded: %s; add <actuator> elements to an MJCF of this model",
                    path.name,
                    ", ".join(found.controlled_joints),
                )
            return model
    return mujoco.MjModel.from_xml_path(str(path))


def _compile_archive(path: Path) -> mujoco.MjModel:
    with zipfile.ZipFile(path) as archive:
        texts = [name for name in archive.namelist() if name.endswith(".xml")]
        if not any(lidar_extension.PLUGIN.encode() in archive.read(name) for name in texts):
            return _compile_archive_as_it_is(path)
        files = {info.filename: archive.read(info) for info in archive.infolist() if not info.is_dir()}
    # As in MuJoCo, the main file has the name of the archive; if there is none, it is the last file.
    main = next((name for name in texts if Path(name).stem == path.stem), texts[-1])
    files |= lidar_extension.overlay(main, files.get)
    with tempfile.TemporaryDirectory() as folder:
        changed = Path(folder) / path.name
        with zipfile.ZipFile(changed, "w") as archive:
            for name, content in files.items():
                archive.writestr(name, content)
        return _compile_archive_as_it_is(changed)


def _compile_archive_as_it_is(path: Path) -> mujoco.MjModel:
    model: mujoco.MjModel
    try:
        model = mujoco.MjSpec.from_file(str(path)).compile()
    except ValueError:
        # MuJoCo's own decoder expects the XML to have the archive's name; `MjSpec.to_zip` gives it the model's name.
        with path.open("rb") as file:
            model = mujoco.MjSpec.from_zip(file).compile()
    return model
