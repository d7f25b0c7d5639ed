"""Converted robots of earlier runs. A robot is converted again if its files, the options or the versions change."""

import contextlib
import hashlib
import json
import os
import re
import shutil
from collections.abc import Callable, Iterator, Mapping
from importlib import metadata
from pathlib import Path
from xml.etree import ElementTree

import mujoco

from mjplug.convert.beside import written_beside
from mjplug.convert.conversion import Conversion
from mjplug.convert.mesh_files import MeshFiles
from mjplug.convert.options import ConversionOptions
from mjplug.convert.pid_gains import gains_files
from mjplug.convert.record import FORMAT
from mjplug.convert.report import RECORD
from mjplug.convert.scene import asset_files
from mjplug.convert.source import Source
from mjplug.errors import ModelError
from mjplug.model.packages import Packages

_LIBRARIES = ("mjplug", "trimesh", "pycollada", "fast-simplification", "coacd", "numpy")
_BESIDE = (".mtl", ".png", ".jpg", ".jpeg", ".bmp", ".tga", ".tif", ".tiff", ".bin")
"""Suffixes of files that a mesh file may refer to."""

_REFERENCE = re.compile(
    rb"[^\s\"'<>]+(?:" + b"|".join(re.escape(end.encode()) for end in _BESIDE) + rb")\b", re.IGNORECASE
)
"""A name of such a file."""


def cache_folder(environ: Mapping[str, str] = os.environ) -> Path:
    """Returns the folder of the cache: `$XDG_CACHE_HOME/mjplug`, or `~/.cache/mjplug`."""
    base = environ.get("XDG_CACHE_HOME")
    return (Path(base) if base and Path(base).is_absolute() else Path.home() / ".cache") / "mjplug"


def key_of(source: Source, options: ConversionOptions, packages: Packages) -> str:
    """Returns a hash of everything that a conversion depends on."""
    state = hashlib.blake2b(digest_size=16)

    def add(*parts: object) -> None:
        for part in parts:
            content = part if isinstance(part, bytes) else str(part).encode()
            state.update(len(content).to_bytes(8, "little") + content)

    # The converter's own files instead of a version, which a change of its rules could leave behind.
    own = sorted(file for file in Path(__file__).parent.rglob("*") if file.suffix in (".py", ".xml"))
    add(*(file.read_bytes() for file in own))
    add(FORMAT, mujoco.mj_versionString(), *(f"{name} {_version(name)}" for name in _LIBRARIES))
    add(options.model_dump_json(exclude={"packages"}), source.path.name, source.origin)
    add(ElementTree.tostring(source.root), *source.warnings)
    for name in (options.srdf, options.scene, *options.mujoco_inputs):
        if name and Path(name).is_file():
            add(name, Path(name).read_bytes())
    for file in _scene_files(Path(options.scene)):
        add(file, file.read_bytes() if file.is_file() else b"missing")
    finder = MeshFiles(source.path.absolute().parent, packages, bool(source.origin))
    for name in gains_files(source.root):
        with contextlib.suppress(ModelError, OSError):
            add(name, finder.find(name).read_bytes())
    for uri, path in _meshes(source, packages):
        add(uri, b"missing" if path is None else path.read_bytes())
        if path is not None and path.suffix.lower() != ".stl":
            for other in sorted({*_beside(path), *_named_in(path)}):
                add(other, other.stat().st_size, other.stat().st_mtime_ns)
    return state.hexdigest()


def cached(
    source: Source,
    options: ConversionOptions,
    packages: Packages,
    convert: Callable[[], Conversion],
    environ: Mapping[str, str] = os.environ,
) -> Path:
    """Returns the folder of a converted robot; converts it if it is not in the cache.

    Several processes can do this at the same time: each writes its own folder, and the first one is kept.

    Raises:
        ModelError: The conversion fails, or the cache cannot be written.
    """
    folder = cache_folder(environ) / "models" / key_of(source, options, packages)
    if is_complete(folder):
        return folder
    conversion = convert()
    try:
        with written_beside(folder, conversion.files) as beside:
            if folder.exists() and not is_complete(folder):
                shutil.rmtree(folder, ignore_errors=True)
            try:
                beside.rename(folder)
            except OSError:
                # Another process was faster.
                if not is_complete(folder):
                    raise
    except OSError as error:
        raise ModelError(f"the cache {folder.parent} cannot be written: {error.strerror or error}") from error
    return folder


def is_complete(folder: Path) -> bool:
    """Returns whether a folder contains every file of its conversion."""
    try:
        files = json.loads((folder / RECORD).read_text(encoding="utf-8"))["files"]
    except (OSError, ValueError, KeyError, TypeError):
        return False
    return all((folder / name).is_file() for name in files)


def _meshes(source: Source, packages: Packages) -> Iterator[tuple[str, Path | None]]:
    finder = MeshFiles(source.path.absolute().parent, packages, bool(source.origin))
    for uri in sorted({mesh.get("filename", "") for mesh in source.root.iter("mesh")} - {""}):
        try:
            yield uri, finder.find(uri)
        except ModelError:
            yield uri, None


def _beside(path: Path) -> list[Path]:
    """Returns the files in the folder of a mesh that it may refer to."""
    return [other for other in path.parent.iterdir() if other.suffix.lower() in _BESIDE]


def _named_in(path: Path) -> Iterator[Path]:
    """Yields the existing files that a mesh file or its materials name, which may be in other folders."""
    for name in set(_REFERENCE.findall(path.read_bytes())):
        with contextlib.suppress(OSError, ValueError):
            other = path.parent / os.fsdecode(name)
            if other.is_file():
                yield other
                if other.suffix.lower() == ".mtl" and path.suffix.lower() != ".mtl":
                    yield from _named_in(other)


def _scene_files(path: Path) -> list[Path]:
    """Returns the files that a scene of the user names; none if it cannot be read."""
    if not path.is_file():
        return []
    try:
        root = ElementTree.parse(path).getroot()
    except (OSError, ElementTree.ParseError):
        return []
    return [file for _, _, file in asset_files(root, path.parent)]


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "-"
