"""Prepares a URDF for MuJoCo: keeps all links, and finds meshes the way ROS does."""

import os
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from mjplug.errors import ModelError
from mjplug.model.location import PACKAGE, locate_in_package

_READABLE = (".stl", ".obj", ".msh")


@dataclass(frozen=True, slots=True)
class Urdf:
    """A URDF that MuJoCo can compile from memory.

    Attributes:
        xml: The text, with mesh names in place of URIs and paths.
        assets: The meshes, by these names.
    """

    xml: str
    assets: dict[str, bytes]


def prepared(path: Path, environ: Mapping[str, str] = os.environ) -> Urdf | None:
    """Reads a URDF and its meshes.

    MuJoCo merges links without a joint that moves into their parents, the root into the world, so that their frames
    are gone. Here they stay, unless the URDF's own `<mujoco><compiler fusestatic="true"/></mujoco>` says otherwise.

    MuJoCo takes `package://` for a folder of that name; here packages are looked up. MuJoCo calls a mesh like its file
    and takes the second file of a name for the first, as in `visual/link.stl` and `collision/link.stl`; so every file
    gets a name of its own here.

    Args:
        path: The URDF.
        environ: Where packages are looked for; the folders around the URDF are tried besides.

    Returns:
        None for text that is no URDF: MuJoCo can say what it is, or read it from the file.

    Raises:
        ModelError: A mesh does not exist, or is of a kind that MuJoCo does not read.
    """
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    try:
        root = ElementTree.parse(path, parser).getroot()
    except (ElementTree.ParseError, LookupError, ValueError):
        # LookupError and ValueError are about encodings that are unknown, or of several bytes.
        return None
    if root.tag != "robot":
        return None
    options = _compiler(root).attrib
    options.setdefault("fusestatic", "false")
    # MuJoCo drops the visual geoms of a URDF unless told otherwise, and never opens their meshes.
    kinds = ("collision", "visual") if options.get("discardvisual") == "false" else ("collision",)
    meshes = [mesh for kind in kinds for mesh in root.findall(f"link/{kind}/geometry/mesh") if mesh.get("filename")]
    names: dict[Path, str] = {}
    for mesh in meshes:
        file = _find(mesh.get("filename", ""), path, options, environ)
        names.setdefault(file, _free_name(file, names.values()))
        mesh.set("filename", names[file])
    for option in ("meshdir", "assetdir", "strippath"):
        options.pop(option, None)
    return Urdf(
        ElementTree.tostring(root, encoding="unicode"), {name: file.read_bytes() for file, name in names.items()}
    )


def _compiler(root: ElementTree.Element) -> ElementTree.Element:
    """Returns the element with MuJoCo's options of a URDF, which is added if there is none."""
    extension = root.find("mujoco")
    if extension is None:
        extension = ElementTree.SubElement(root, "mujoco")
    compiler = extension.find("compiler")
    return ElementTree.SubElement(extension, "compiler") if compiler is None else compiler


def _find(filename: str, urdf: Path, options: Mapping[str, str], environ: Mapping[str, str]) -> Path:
    folder = urdf.absolute().parent
    beside = folder / (options.get("meshdir") or options.get("assetdir") or "")
    if Path(filename).suffix.lower() not in _READABLE:
        raise ModelError(
            f"{urdf}: MuJoCo reads no {Path(filename).suffix} meshes, only {', '.join(_READABLE)}: {filename!r}"
        )
    if filename.startswith(PACKAGE):
        try:
            return locate_in_package(filename, environ, list(folder.parents) + [folder]).resolve()
        except ModelError as error:
            if (beside / Path(filename).name).is_file():
                return (beside / Path(filename).name).resolve()
            raise ModelError(f"{urdf}: {error}, nor in a folder around the URDF") from None
    name = filename.removeprefix("file://")
    # MuJoCo strips the folders of a URDF's meshes unless told otherwise; other programs count them from the URDF.
    ways = [beside / name, folder / name, beside / Path(name).name]
    strip = options.get("strippath")
    candidates = ways[2:] if strip == "true" else ways[:2] if strip == "false" else ways
    for file in candidates:
        if file.is_file():
            return file.resolve()
    others = f", nor {str(candidates[1])!r}" if len(dict.fromkeys(candidates[:2])) > 1 else ""
    raise ModelError(f"{urdf}: there is no mesh {str(candidates[0])!r}{others}")


def _free_name(file: Path, taken: Collection[str]) -> str:
    """Returns the file's name, with as many folders in front as give it a stem that no other mesh has."""
    parts = file.with_suffix("").parts[1:]
    stems = ["_".join(parts[-count:]) for count in range(1, len(parts) + 1)]
    stems.append(f"{stems[-1]}_{file.suffix.removeprefix('.')}")
    used = {Path(name).stem.lower() for name in taken}
    return next(stem for stem in stems if stem.lower() not in used) + file.suffix
