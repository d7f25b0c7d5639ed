"""Definitions of types, with nested types indented below their fields."""

import re
from collections.abc import Iterator
from typing import Any

from mjplug_schemas.definition import definition
from mjplug_schemas.errors import UnknownType
from mjplug_schemas.registry import find

_NESTED = re.compile(r"(?P<package>[a-z]\w*)/(?P<name>[A-Z]\w*)(\[[^\]]*\])? ")
"""Start of the line of a field whose type is a message."""


def definition_lines(interface: Any, comments: bool = True, inner_comments: bool = False) -> Iterator[str]:
    """Yields the lines of a definition in the format of .msg, .srv and .action files.

    Args:
        interface: The class of a message, service or action.
        comments: Whether to keep its comments and empty lines.
        inner_comments: Whether to keep those of nested types.
    """
    for line in definition(interface).rstrip("\n").split("\n"):
        if comments or (line and not line.startswith("#")):
            yield line
        if nested := _NESTED.match(line):
            inner = _find(nested["package"], nested["name"])
            for below in definition_lines(inner, inner_comments, inner_comments):
                yield f"\t{below}" if below else ""


def _find(package: str, name: str) -> Any:
    """Returns the class of a nested type, which may be part of an action, such as `FollowJointTrajectory_Goal`."""
    try:
        return find(f"{package}/msg/{name}")
    except UnknownType:
        return find(f"{package}/action/{name}")
