"""Conversion of classes, type names and dictionaries to messages."""

import base64
import json
from typing import Any

from mjplug.client.errors import WrongTypeError
from mjplug_schemas import registry
from mjplug_schemas.errors import CodecError, UnknownType
from mjplug_schemas.message import Message, Service

Fields = dict[str, Any]
"""A message as nested dictionaries and lists, with ROS field names."""


def find(name: str) -> type[Any]:
    """Returns the class of a ROS type.

    Args:
        name: Such as `std_msgs/msg/String` or `std_srvs/srv/Trigger`.

    Raises:
        WrongTypeError: `mjplug_schemas` does not contain the type, and the program has not registered it.
    """
    try:
        return registry.find(name)
    except UnknownType as error:
        raise WrongTypeError(str(error)) from None


def known(name: str) -> type[Any] | None:
    """Returns the class of a ROS type, or None if it is not registered."""
    try:
        return registry.find(name)
    except UnknownType:
        return None


def message_class(kind: Any) -> type[Any]:
    """Returns the message class for a class, the name of a type, or `dict`.

    Raises:
        WrongTypeError: The value has another type.
    """
    found = find(kind) if isinstance(kind, str) else kind
    if found is dict or (isinstance(found, type) and issubclass(found, Message)):
        return found
    if isinstance(found, type) and issubclass(found, Service):
        raise WrongTypeError(f"{found.TYPE} is a service; a topic has a message type")
    raise WrongTypeError(f"{kind!r} is not a message type; give a class of mjplug_schemas, its ROS name, or dict")


def as_message(given: Any, kind: type[Message]) -> Message:
    """Returns a message of a type from a message or from nested dictionaries.

    Raises:
        WrongTypeError: The message has another type, or the dictionary does not match; the error names the field.
    """
    if isinstance(given, Message):
        if not isinstance(given, kind):
            raise WrongTypeError(f"expected {kind.TYPE}, not {given.TYPE}")
        return given
    if not isinstance(given, dict):
        raise WrongTypeError(f"expected {kind.TYPE} or a dictionary of its fields, not {given!r}")
    try:
        return kind.from_json(to_json(given))
    except CodecError as error:
        raise WrongTypeError(str(error)) from None


def to_json(fields: Any) -> bytes:
    """Returns nested dictionaries as JSON; arrays become lists, bytes become base64.

    Raises:
        WrongTypeError: A value cannot be written in JSON.
    """
    try:
        return json.dumps(fields, default=_plain).encode()
    except (TypeError, ValueError) as error:
        raise WrongTypeError(f"this is not a message: {error}") from None


def _plain(value: Any) -> Any:
    if isinstance(value, Message):
        return json.loads(value.to_json())
    if isinstance(value, bytes | bytearray | memoryview):
        return base64.b64encode(value).decode()
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{value!r} cannot be written in JSON")
