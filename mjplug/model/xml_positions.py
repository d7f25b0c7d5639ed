"""Parses XML with the position of every element in the file, for edits that do not change the rest of the file."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple
from xml.parsers import expat

_TAG = re.compile(rb"""<(?:[^>"']|"[^"]*"|'[^']*')*>""")


@dataclass(slots=True, eq=False)
class Element:
    """An element and its position.

    Attributes:
        tag: Tag name.
        attributes: Attributes.
        line: Line of the start, from 1.
        start: Start of the element [bytes].
        inner_end: Start of its end tag; for an empty element, its end [bytes].
        end: End of the element [bytes].
        children: Child elements.
    """

    tag: str
    attributes: dict[str, str]
    line: int
    start: int
    inner_end: int = 0
    end: int = 0
    children: list["Element"] = field(default_factory=list)

    def descendants(self) -> Iterator[tuple["Element", "Element"]]:
        """Yields every element below this one with its parent, in the order of the file."""
        for child in self.children:
            yield child, self
            yield from child.descendants()


class Edit(NamedTuple):
    """The replacement of a part of a file.

    Attributes:
        start: Start of the part [bytes].
        end: End of the part [bytes].
        text: The replacement.
    """

    start: int
    end: int
    text: str = ""


def parse(content: bytes) -> Element:
    """Returns the root element.

    Raises:
        expat.ExpatError: The content is not XML.
    """
    parser = expat.ParserCreate()
    top = Element("", {}, 0, 0)
    open_elements = [top]

    def start(tag: str, attributes: dict[str, str]) -> None:
        element = Element(tag, attributes, parser.CurrentLineNumber, parser.CurrentByteIndex)
        open_elements[-1].children.append(element)
        open_elements.append(element)

    def end(tag: str) -> None:
        element = open_elements.pop()
        opening = _TAG.match(content, element.start)
        assert opening is not None
        empty = opening[0].endswith(b"/>")
        element.inner_end = opening.end() if empty else parser.CurrentByteIndex
        element.end = opening.end() if empty else content.index(b">", element.inner_end) + 1

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.Parse(content, True)
    return top.children[0]


def edited(content: bytes, edits: Iterable[Edit]) -> bytes:
    """Returns a file with edits applied; line numbers after the edits do not change.

    Args:
        content: The content of the file.
        edits: Edits that do not overlap.
    """
    pieces: list[bytes] = []
    at = 0
    for edit in sorted(edits):
        removed = content[edit.start : edit.end]
        pieces += [content[at : edit.start], edit.text.encode(), b"\n" * removed.count(b"\n")]
        at = edit.end
    return b"".join([*pieces, content[at:]])
