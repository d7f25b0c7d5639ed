"""The definition of a type with those inside it, indented below the fields that have them."""

import re
from collections.abc import Iterator
from typing import Any

from mjplug_schemas.definition import definition
from mjplug_schemas.registry import find

_NESTED = re.compile(r"(?P<package>[a-z]\w*)/(?P<name>[A-Z]\w*)(\[[^\]]*\])? ")
"""How the line of a field begins whose type is a message."""


def definition_lines(interface: Any, comments: bool = True, inner_comments: bool = False) -> Iterator[str]:
    """Yields the lines of a definition, as ROS has it in its .msg and .srv files.

    Args:
        interface: The class of a message or service.
        comments: Whether to keep its comments and empty lines.
        inner_comments: Whether to keep those of the types inside it.
    """
    for line in definition(interface).rstrip("\n").split("\n"):
        if comments or (line and not line.startswith("#")):
            yield line
        if nested := _NESTED.match(line):
            inner = find(f"{nested['package']}/msg/{nested['name']}")
            for below in definition_lines(inner, inner_comments, inner_comments):
                yield f"\t{below}" if below else ""
