"""Prepares a URDF for MuJoCo: keeps all links, and finds meshes as ROS does."""

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
        xml: The text of the URDF, with mesh names instead of URIs and paths.
        assets: The meshes by name.
        controlled_joints: Joints of its `<ros2_control>` elements, which MuJoCo does not read.
    """

    xml: str
    assets: dict[str, bytes]
    controlled_joints: tuple[str, ...] = ()


def prepared(path: Path, environ: Mapping[str, str] = os.environ) -> Urdf | None:
    """Reads a URDF and its meshes.

    By default, MuJoCo merges a link without a moving joint into its parent, and the root link into the world, so that
    their frames are lost. Here they are kept, unless the URDF contains
    `<mujoco><compiler fusestatic="true"/></mujoco>`.

    MuJoCo treats `package://` as a folder of that name; here packages are searched. MuJoCo names a mesh after its file
    and confuses two files of the same name, such as `visual/link.stl` and `collision/link.stl`; here every file gets a
    unique name.

    Args:
        path: The URDF.
        environ: Environment variables for the search of packages. The folders above the URDF are searched too.

    Returns:
        The prepared URDF; None if the file is not a URDF, so that MuJoCo can read it or report the error.

    Raises:
        ModelError: A mesh does not exist, or MuJoCo does not support its format.
    """
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    try:
        root = ElementTree.parse(path, parser).getroot()
    except (ElementTree.ParseError, LookupError, ValueError):
        # LookupError and ValueError are raised for unknown and multi-byte encodings.
        return None
    if root.tag != "robot":
        return None
    options = _compiler(root).attrib
    options.setdefault("fusestatic", "false")
    # By default, MuJoCo discards the visual geoms of a URDF and does not open their meshes.
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
        ElementTree.tostring(root, encoding="unicode"),
        {name: file.read_bytes() for file, name in names.items()},
        tuple(dict.fromkeys(joint.get("name", "") for joint in root.iterfind("ros2_control/joint[command_interface]"))),
    )


def _compiler(root: ElementTree.Element) -> ElementTree.Element:
    """Returns the element with MuJoCo's compiler options in a URDF; adds it if there is none."""
    extension = root.find("mujoco")
    if extension is None:
        extension = ElementTree.SubElement(root, "mujoco")
    compiler = extension.find("compiler")
    return ElementTree.SubElement(extension, "compiler") if compiler is None else compiler


def _find(filename: str, urdf: Path, options: Mapping[str, str], environ: Mapping[str, str]) -> Path:
    folder = urdf.absolute().parent
    mesh_folder = folder / (options.get("meshdir") or options.get("assetdir") or "")
    if Path(filename).suffix.lower() not in _READABLE:
        raise ModelError(
            f"{urdf}: MuJoCo does not support the mesh format of {filename!r}; supported: {', '.join(_READABLE)}"
        )
    if filename.startswith(PACKAGE):
        try:
            return locate_in_package(filename, environ, folder).resolve()
        except ModelError as error:
            if (mesh_folder / Path(filename).name).is_file():
                return (mesh_folder / Path(filename).name).resolve()
            raise ModelError(f"{urdf}: {error}") from None
    name = filename.removeprefix("file://")
    # By default, MuJoCo removes the folders from mesh file names; for other programs, they are relative to the URDF.
    choices = [mesh_folder / name, folder / name, mesh_folder / Path(name).name]
    strip = options.get("strippath")
    candidates = choices[2:] if strip == "true" else choices[:2] if strip == "false" else choices
    for file in candidates:
        if file.is_file():
            return file.resolve()
    others = f", nor {str(candidates[1])!r}" if len(dict.fromkeys(candidates[:2])) > 1 else ""
    raise ModelError(f"{urdf}: there is no mesh {str(candidates[0])!r}{others}")


def _free_name(file: Path, taken: Collection[str]) -> str:
    """Returns the file's name, with as many parent folders in front as needed for a unique stem."""
    parts = file.with_suffix("").parts[1:]
    stems = ["_".join(parts[-count:]) for count in range(1, len(parts) + 1)]
    stems.append(f"{stems[-1]}_{file.suffix.removeprefix('.')}")
    used = {Path(name).stem.lower() for name in taken}
    return next(stem for stem in stems if stem.lower() not in used) + file.suffix
