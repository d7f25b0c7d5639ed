"""What users type as a message or request: YAML flow text, as ros2 takes it."""

import re
from typing import Any

from mjplug.client import WrongTypeError

_TYPE = re.compile(r"[A-Za-z]\w*/((msg|srv|action)/)?[A-Za-z]\w*")


def split_type(first: str | None, second: str | None) -> tuple[str | None, str | None]:
    """Tells a type from values, since the type may be left out.

    Args:
        first: What stands after the name.
        second: What stands after that.

    Returns:
        The type and the values, each None if it is not there.
    """
    if second is None and first is not None and not _TYPE.fullmatch(first):
        return None, first
    return first, second


def full_type(name: str, kind: str) -> str:
    """Returns a type name with its middle part, which users may leave out: `std_msgs/String`."""
    parts = name.split("/")
    return f"{parts[0]}/{kind}/{parts[1]}" if len(parts) == 2 else name


def parse(text: str | None) -> dict[str, Any]:
    """Returns the fields that YAML text holds; none at all for no text.

    Raises:
        WrongTypeError: It is no YAML, or no mapping.
    """
    from mjplug.config.document import parse_document
    from mjplug.config.problem import ConfigError, Source

    if text is None or not text.strip():
        return {}
    try:
        document = parse_document(text, Source("the values"))
    except ConfigError as error:
        raise WrongTypeError(error.problems[0].message + _HINT) from None
    if document.problems:
        raise WrongTypeError(document.problems[0].message + _HINT)
    if not isinstance(document.value, dict):
        raise WrongTypeError(f"{text!r} has no fields in it{_HINT}")
    return document.value


_HINT = "; write fields as YAML, with a blank after each colon: '{linear: {x: 0.5}}'"
