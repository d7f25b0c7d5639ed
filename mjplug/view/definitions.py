"""Definitions of types with all nested types, in the format that recordings of ROS messages use."""

import re
from collections.abc import Callable
from functools import cache

from mjplug.client.errors import WrongTypeError
from mjplug.client.types import find
from mjplug_schemas.definition import definition
from mjplug_schemas.message import Message, Service

_SEPARATOR = "=" * 80

_NESTED = re.compile(r"^(?P<package>[a-z]\w*)/(?P<name>[A-Z]\w*)(?=[\s\[])", re.MULTILINE)
"""The type of a field that is a message, at the start of a line."""


def with_nested(text: str, find_definition: Callable[[str], str]) -> str:
    """Returns the definition of a message, followed by those of all nested types under headings `MSG: package/Name`.

    Args:
        text: The definition of the message.
        find_definition: Returns the definition of a type such as `std_msgs/msg/Header`.
    """
    parts, seen, pending = [text], set(), [text]
    while pending:
        for match in _NESTED.finditer(pending.pop(0)):
            if match[0] in seen:
                continue
            seen.add(match[0])
            inner = find_definition(f"{match['package']}/msg/{match['name']}")
            parts.append(f"{_SEPARATOR}\nMSG: {match[0]}\n{inner}")
            pending.append(inner)
    return "".join(part if part.endswith("\n") else f"{part}\n" for part in parts)


@cache
def message_definition(type: str) -> str:
    """Returns the definition of a message type, with nested types.

    Args:
        type: Such as `sensor_msgs/msg/JointState`, or a part of a service such as `std_srvs/srv/Trigger_Request`.

    Raises:
        WrongTypeError: `mjplug_schemas` does not contain the type, or it is a service.
    """
    found = find(type)
    if not issubclass(found, Message):
        raise WrongTypeError(f"{type} is a service; a topic has a message type")
    return with_nested(definition(found), lambda name: definition(find(name)))


def definitions(type: str) -> dict[str, str]:
    """Returns `definition` of a message type, or `request` and `response` of a service type.

    Raises:
        WrongTypeError: `mjplug_schemas` does not contain the type.
    """
    if issubclass(find(type), Service):
        return {
            "request": message_definition(f"{type}_Request"),
            "response": message_definition(f"{type}_Response"),
        }
    return {"definition": message_definition(type)}
