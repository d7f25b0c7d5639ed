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


def check_files(root: Element, packages: Packages, relative: bool = True) -> None:
    """Checks all names of files in MJCF.

    Args:
        root: The MJCF, or elements of it.
        packages: ROS packages.
        relative: Whether names can be relative to the folders that the MJCF's `<compiler>` elements name.

    Raises:
        ModelError: It names a file outside of ROS packages, or includes other MJCF.
    """
    # MuJoCo ignores namespaces, so the checks do too.
    elements = [(element, _local(element.tag)) for element in root.iter() if isinstance(element.tag, str)]
    compilers = [element for element, tag in elements if tag == "compiler"]
    folders = {
        kind: [element.attrib[name] for element in compilers for name in (kind, "assetdir") if name in element.attrib]
        for kind in ("meshdir", "texturedir")
    }
    for element, tag in elements:
        if tag in _FORBIDDEN:
            raise ModelError(f"MJCF from a topic cannot contain <{tag}>")
        for attribute, name in element.attrib.items():
            # With `strippath`, MuJoCo reads files from these folders that no attribute names.
            if attribute in _FOLDERS and name:
                check_file(name, packages)
            elif attribute.startswith("file") and name:
                given = folders["texturedir" if tag == "texture" else "meshdir"] if relative else []
                # Of several folders, which one MuJoCo uses depends on their order, so the file must be valid in each.
                for folder in given or [""]:
                    check_file(os.path.join(folder, name), packages)


def _local(tag: str) -> str:
    return tag.rpartition("}")[2].rpartition(":")[2]
