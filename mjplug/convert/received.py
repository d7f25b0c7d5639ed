"""Models that arrive as text from a topic: they may name only files in ROS packages, and no code is run for them.

A client that can publish on the topic chooses what is simulated. The rules here keep such a text from reading other
files of this machine, and from evaluating xacro.
"""

import os
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from mjplug.convert.confined import check_files
from mjplug.convert.record import digest
from mjplug.convert.source import Source
from mjplug.errors import ModelError
from mjplug.model.packages import Packages

_MAX_DEPTH = 200
"""Largest depth of the XML; some of its readers recurse."""

_XACRO = tuple(f"{{http://{host}/xacro}}" for host in ("www.ros.org/wiki", "ros.org/wiki", "wiki.ros.org"))


@dataclass(frozen=True, slots=True)
class ReceivedModel:
    """A model from a topic.

    Attributes:
        topic: Full name of the topic.
        path: A file with its text in the cache: `.urdf`, or `.xml` for MJCF.
    """

    topic: str
    path: Path

    @property
    def is_description(self) -> bool:
        """Whether it is a URDF, which is converted, and not MJCF."""
        return self.path.suffix == ".urdf"


def check_text(text: str) -> None:
    """Checks that a text is a URDF or MJCF.

    Raises:
        ModelError: It is not.
    """
    _parsed(text)


def store(topic: str, text: str, folder: Path) -> ReceivedModel:
    """Writes a text to a file, whose name is always the same for the same text.

    Args:
        topic: Full name of the topic.
        text: The URDF or MJCF.
        folder: The folder of the cache.

    Raises:
        ModelError: The text is neither URDF nor MJCF, or the file cannot be written.
    """
    suffix = ".urdf" if _parsed(text).tag == "robot" else ".xml"
    content = text.encode()
    own = folder / "received" / digest(content)
    path = own / f"{topic.rpartition('/')[2]}{suffix}"
    try:
        if not path.is_file() or path.read_bytes() != content:
            own.mkdir(parents=True, exist_ok=True)
            handle, beside = tempfile.mkstemp(dir=own)
            with os.fdopen(handle, "wb") as file:
                file.write(content)
            Path(beside).replace(path)
    except OSError as error:
        raise ModelError(f"the cache {own} cannot be written: {error.strerror or error}") from error
    return ReceivedModel(topic, path)


def read_received(model: ReceivedModel, arguments: Mapping[str, str], packages: Packages) -> Source:
    """Returns a received URDF.

    Raises:
        ModelError: It uses xacro, or names a file outside of ROS packages in MJCF.
    """
    origin = f"the URDF on {model.topic}"
    root = _parsed(model.path.read_text(encoding="utf-8"))
    if any(isinstance(element.tag, str) and element.tag.startswith(_XACRO) for element in root.iter()):
        raise ModelError(f"{origin} contains elements of xacro, which are not evaluated; publish the expanded URDF")
    if arguments:
        raise ModelError(f"{origin} has no xacro arguments; these were given: {', '.join(arguments)}")
    if root.find("link") is None:
        raise ModelError(f"{origin} contains no link")
    for inputs in root.iterfind("mujoco_inputs"):
        try:
            # They become part of a model in another folder, so relative names would have no meaning.
            check_files(inputs, packages, relative=False)
        except ModelError as error:
            raise ModelError(f"<mujoco_inputs> of {origin}: {error}") from error
    source = Source(model.path, root, origin=origin)
    if root.find("mujoco") is not None:
        source.warnings.append("the element <mujoco> is not used, because the URDF comes from a topic")
    return source


def check_received(model: ReceivedModel, packages: Packages) -> None:
    """Checks received MJCF, which MuJoCo reads itself.

    Raises:
        ModelError: It names a file outside of ROS packages, or includes other MJCF.
    """
    try:
        check_files(_parsed(model.path.read_text(encoding="utf-8")), packages)
    except ModelError as error:
        raise ModelError(f"the MJCF on {model.topic}: {error}") from error


def _parsed(text: str) -> Element:
    parser = ElementTree.XMLParser(target=_Builder())
    try:
        # Without the declared encoding, which is that of the file before it became a message.
        parser.feed(text.lstrip("\ufeff"))
        root: Element = parser.close()
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise ModelError(f"it is not valid XML: {error}") from error
    if root.tag not in ("robot", "mujoco"):
        raise ModelError(f"its root element is <{root.tag}>; a URDF begins with <robot>, and MJCF with <mujoco>")
    return root


class _Builder(ElementTree.TreeBuilder):
    """Builds the tree of a text that others have written."""

    def __init__(self) -> None:
        super().__init__()
        self._depth = 0

    def start(self, tag: Any, attrs: Any, /) -> Element:
        self._depth += 1
        if self._depth > _MAX_DEPTH:
            raise ModelError(f"its XML is more than {_MAX_DEPTH} elements deep")
        return super().start(tag, attrs)

    def end(self, tag: Any, /) -> Element:
        self._depth -= 1
        return super().end(tag)

    def doctype(self, *_: Any) -> None:
        raise ModelError("it contains a document type declaration, which may define entities")
