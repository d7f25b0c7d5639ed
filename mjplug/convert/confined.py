"""The files that a model from a topic may name: only those in ROS packages, so that it cannot read others."""

import os
from pathlib import Path
from urllib.parse import unquote
from xml.etree.ElementTree import Element

from mjplug.errors import ModelError
from mjplug.model.packages import Packages

_FOLDERS = ("meshdir", "texturedir", "assetdir")
_FORBIDDEN = ("include", "model")
"""Elements of MJCF that read other MJCF files, which are not checked."""


def check_file(name: str, packages: Packages) -> Path:
    """Returns the path of a file or folder that a model from a topic names.

    Args:
        name: A path, with or without `file://`.
        packages: ROS packages.

    Raises:
        ModelError: The path is relative, or outside of ROS packages.
    """
    path = Path(os.path.normpath(unquote(name.removeprefix("file://")) if name.startswith("file://") else name))
    if not path.is_absolute():
        raise ModelError(
            f"{name!r} is a relative path; a model from a topic can name files by package:// or absolutely"
        )
    if not packages.contain(path):
        raise ModelError(
            f"{name!r} is in no ROS package; a model from a topic can only name files in packages (if you trust its "
            "folder, add that to model_options.packages)"
        )
    return path


def check_files(root: Element, packages: Packages) -> None:
    """Checks all names of files in MJCF.

    Raises:
        ModelError: It names a file outside of ROS packages, or includes other MJCF.
    """
    elements = [element for element in root.iter() if isinstance(element.tag, str)]
    folders = {
        attribute: element.attrib[attribute]
        for element in elements
        if element.tag == "compiler"
        for attribute in _FOLDERS
        if element.get(attribute)
    }
    for element in elements:
        if element.tag in _FORBIDDEN:
            raise ModelError(f"MJCF from a topic cannot contain <{element.tag}>")
        for attribute, name in element.attrib.items():
            # With `strippath`, MuJoCo reads files from these folders that no attribute names.
            if attribute in _FOLDERS and name:
                check_file(name, packages)
            elif attribute.startswith("file") and name:
                kind = "texturedir" if element.tag == "texture" else "meshdir"
                check_file(os.path.join(folders.get(kind) or folders.get("assetdir") or "", name), packages)
