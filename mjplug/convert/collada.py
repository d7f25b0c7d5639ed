"""COLLADA files (`.dae`): their units and axes, and files with materials whose definition is incomplete."""

import io
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from mjplug.convert.extras import required


def is_y_up(path: Path) -> bool:
    """Returns whether a file is a COLLADA file whose y axis is up."""
    if path.suffix.lower() != ".dae":
        return False
    with path.open("rb") as file:
        return b"Y_UP" in file.read(4096)


def meters(units: str | None) -> float:
    """Returns the length of a unit that trimesh describes as `0.001 * meters` [m]."""
    number = (units or "").partition("*")[0]
    try:
        return float(number)
    except ValueError:
        return 1.0


def read_collada(path: Path) -> Any:
    """Returns the scene of a COLLADA file, read by trimesh.

    The reader leaves out each object that uses a material whose definition is incomplete, such as one with a texture
    that is missing. Here, such objects are kept and lose the material.
    """
    trimesh = required("trimesh", f"the mesh {path.name}")
    root = ElementTree.parse(path).getroot()
    broken = _broken_materials(root)
    if not broken:
        return trimesh.load_scene(path, resolver=resolver_of(path), process=False)
    for parent in list(root.iter()):
        for use in [child for child in parent if _tag(child) == "instance_material"]:
            if use.get("target", "").removeprefix("#") in broken:
                parent.remove(use)
    text = io.BytesIO(ElementTree.tostring(root))
    return trimesh.load_scene(text, file_type="dae", resolver=resolver_of(path), process=False)


def resolver_of(path: Path) -> Any:
    """Returns what finds the files that a mesh file names, also outside of its folder, such as `../textures/a.png`."""
    resolver = required("trimesh", f"the mesh {path.name}").resolvers.FilePathResolver
    try:
        return resolver(str(path), allow_anywhere=True)
    except TypeError:
        # Older versions always allow this.
        return resolver(str(path))


def _broken_materials(root: Element) -> set[str]:
    """Returns the used materials that do not exist, or whose effect is missing or incomplete."""
    images, sids, effects, materials = set(), set(), {}, {}
    for element in root.iter():
        kind, name = _tag(element), element.get("id", "")
        if kind == "image":
            images.add(name)
        elif kind == "newparam":
            sids.add(element.get("sid", ""))
        elif kind == "effect":
            effects[name] = element
        elif kind == "material":
            materials[name] = element
    complete = {name for name, effect in effects.items() if _is_complete(effect, images, sids)}
    used = {use.get("target", "").removeprefix("#") for use in root.iter() if _tag(use) == "instance_material"}
    return {name for name in used if name not in materials or not _effects(materials[name]) <= complete}


def _is_complete(effect: Element, images: set[str], sids: set[str]) -> bool:
    for element in effect.iter():
        for child in element:
            text = (child.text or "").strip()
            if _tag(element) == "sampler2D" and _tag(child) == "source" and text not in sids:
                return False
            if _tag(element) == "surface" and _tag(child) == "init_from" and text not in images:
                return False
    return True


def _effects(material: Element) -> set[str]:
    uses = (element for element in material.iter() if _tag(element) == "instance_effect")
    return {element.get("url", "").removeprefix("#") for element in uses}


def _tag(element: Element) -> str:
    return element.tag.rpartition("}")[2]
