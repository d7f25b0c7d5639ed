"""Puts a robot into a scene: one of the library, or an MJCF file of the user."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import mujoco
import numpy as np

from mjplug.convert.materials import free_name
from mjplug.convert.mjcf import xml_text
from mjplug.convert.rotations import numbers
from mjplug.errors import ModelError, did_you_mean

ROBOT_FILE, SCENE_FILE = "robot.xml", "scene.xml"
HOME = "home"
NONE, DEFAULT = "none", "floor"

_TABLE = (-0.4, 0.75)
"""Front edge and height of the table [m]."""

_DISTANCE = 0.35
"""Distance of a free robot from the table [m]."""

_FILES = ("mesh", "texture", "hfield", "skin", "model")
_MIN_EXTENT = 0.8

_CLEARANCE = 0.001
"""Distance of the floor from the lowest link of a robot that hangs down [m]."""


@dataclass(frozen=True, slots=True)
class Placement:
    """Where a robot stands.

    Attributes:
        free: Whether its base is free.
        lowest: Lowest point of its moving links [m].
        front: Its largest x coordinate [m].
        center: Center of its geometry, shape (3,) [m].
        extent: Size of its geometry [m].
    """

    free: bool
    lowest: float
    front: float
    center: tuple[float, float, float]
    extent: float


@dataclass(slots=True)
class Scene:
    """A scene.

    Attributes:
        root: Its `<mujoco>`, which includes the robot.
        files: Contents of its assets by name.
    """

    root: Element
    files: dict[str, bytes] = field(default_factory=dict)

    def text(self) -> str:
        """Returns the XML."""
        return xml_text(self.root)


def scene_names() -> list[str]:
    """Returns the names of the scenes in the library."""
    return sorted(path.name.removesuffix(".xml") for path in _library().iterdir() if path.name.endswith(".xml"))


def build_scene(name: str, robot: str, place: Placement, taken: set[str], given: list[Element]) -> Scene:
    """Returns a scene with a robot.

    Args:
        name: A name of the library, `none`, or a path; empty for `given`, else `floor`.
        robot: Name of the robot, which becomes the name of the model.
        place: Where the robot stands.
        taken: Names of asset files of the robot, in lower case.
        given: Sections of the scene in `<mujoco_inputs>`.

    Raises:
        ModelError: There is no such scene, or it cannot be read.
    """
    if not name and given:
        scene = Scene(Element("mujoco", model=robot))
        _include(scene.root)
        scene.root.extend(given)
        return scene
    name = name or DEFAULT
    if name in scene_names():
        return _bundled(name, robot, place)
    if name == NONE:
        scene = Scene(Element("mujoco", model=robot))
        _include(scene.root)
        return scene
    path = Path(name)
    if not path.is_file():
        raise unknown_scene(name)
    scene = _from_file(path, taken)
    scene.root.set("model", robot)
    return scene


def unknown_scene(name: str) -> ModelError:
    """Returns the error for a scene that is neither in the library nor a file."""
    known = [*scene_names(), NONE]
    return ModelError(
        f"there is no scene {name!r}{did_you_mean(name, known)}; known: {', '.join(known)}, or an MJCF file"
    )


def write_home(root: Element, model: mujoco.MjModel, qpos: np.ndarray, ctrl: np.ndarray) -> None:
    """Adds the keyframe `home`."""
    keyframe = root.find("keyframe")
    keyframe = SubElement(root, "keyframe") if keyframe is None else keyframe
    attributes = {"name": HOME, "qpos": numbers(qpos)}
    if model.nu:
        attributes["ctrl"] = numbers(ctrl)
    SubElement(keyframe, "key", attributes)


def _library() -> resources.abc.Traversable:
    return resources.files("mjplug.convert") / "scenes"


def _include(root: Element) -> None:
    root.insert(0, Element("include", file=ROBOT_FILE))


def _bundled(name: str, robot: str, place: Placement) -> Scene:
    root = bundled_scene(name, place)
    root.set("model", robot)
    _include(root)
    if name != "obstacles":
        center, extent = np.array(place.center), max(place.extent, _MIN_EXTENT)
        if name == "tabletop":
            # Between the robot and the things on the table.
            center, extent = center + (place.front if place.free else 0.25, 0.0, 0.0), extent + 0.5
        statistic = {"center": numbers(center, 3), "extent": numbers([extent], 3)}
        root.append(Element("statistic", statistic))
    return Scene(root)


def bundled_scene(name: str, place: Placement, floor: float | None = None) -> Element:
    """Returns a scene of the library, moved to where the robot stands.

    Args:
        name: Its name.
        place: Where the robot stands.
        floor: Height of the surface on which the robot stands; None if it is at zero, or below its lowest link [m].
    """
    root = ElementTree.fromstring((_library() / f"{name}.xml").read_text(encoding="utf-8"))
    offset = np.array([0.0, 0.0, floor or 0.0])
    if name == "tabletop":
        edge, height = _TABLE
        # A fixed robot is mounted on the table, a free one stands in front of it.
        offset += (place.front + _DISTANCE - edge, 0.0, 0.0) if place.free else (0.0, 0.0, -height)
    if floor is None and not place.free and place.lowest < 0.0:
        offset[2] += place.lowest - _CLEARANCE
    world = root.find("worldbody")
    for element in () if world is None else world:
        position = np.array([float(part) for part in element.get("pos", "0 0 0").split()])
        element.set("pos", numbers(position + offset))
    return root


def corners_of(model: mujoco.MjModel, data: mujoco.MjData, geoms: Sequence[int]) -> np.ndarray:
    """Returns points that enclose some geoms, shape (n, 3); the origin without geoms [m]."""
    if not geoms:
        return np.zeros((1, 3))
    reach, centers = model.geom_rbound[list(geoms)][:, None], data.geom_xpos[list(geoms)]
    return np.concatenate([centers - reach, centers + reach])


def _from_file(path: Path, taken: set[str]) -> Scene:
    try:
        root = ElementTree.parse(path).getroot()
    except OSError as error:
        raise ModelError(f"{path} cannot be read: {error.strerror}") from error
    except ElementTree.ParseError as error:
        raise ModelError(f"{path} is not valid XML: {error}") from error
    if root.tag != "mujoco":
        raise ModelError(f"{path} is not an MJCF file: its root element is <{root.tag}>")
    scene = Scene(root)
    files = asset_files(root, path.parent)
    for compiler in root.iterfind("compiler"):
        for option in ("meshdir", "texturedir", "assetdir", "strippath"):
            compiler.attrib.pop(option, None)
    for element, key, file in files:
        _copy(scene, element, key, file, taken)
    for include in root.iter("include"):
        if Path(include.get("file", "")).name != ROBOT_FILE:
            raise ModelError(f"{path} includes {include.get('file')!r}; a scene may include {ROBOT_FILE} only")
    if not any(True for _ in root.iter("include")):
        _include(root)
    return scene


def asset_files(root: Element, folder: Path) -> list[tuple[Element, str, Path]]:
    """Returns the files that the assets of an MJCF name, with their elements and attributes.

    Args:
        root: Its `<mujoco>`.
        folder: Its folder.
    """
    folders = _asset_folders(root, folder)
    return [
        (element, key, folders[kind] / name)
        for kind in _FILES
        for element in root.iterfind(f"asset/{kind}")
        for key, name in element.attrib.items()
        if key.startswith("file")
    ]


def _asset_folders(root: Element, folder: Path) -> dict[str, Path]:
    options: dict[str, str] = {}
    for compiler in root.iterfind("compiler"):
        options.update(compiler.attrib)
    assets = options.get("assetdir", "")
    meshes, textures = folder / (options.get("meshdir") or assets), folder / (options.get("texturedir") or assets)
    return {"mesh": meshes, "skin": meshes, "texture": textures, "hfield": meshes, "model": folder}


def _copy(scene: Scene, element: Element, key: str, file: Path, taken: set[str]) -> None:
    try:
        content = file.read_bytes()
    except OSError as error:
        raise ModelError(f"the scene needs {file}, which cannot be read: {error.strerror}") from error
    if not element.get("name"):
        element.set("name", file.stem)
    name = free_name(file.stem, taken) + file.suffix
    scene.files[name] = content
    element.set(key, name)
