"""Messages and requests from the command line: YAML in flow style, as for ros2."""

import re
from typing import Any

from mjplug.client import WrongTypeError

_TYPE = re.compile(r"[A-Za-z]\w*/((msg|srv|action)/)?[A-Za-z]\w*")


def split_type(first: str | None, second: str | None) -> tuple[str | None, str | None]:
    """Distinguishes a type from values, because the type is optional.

    Args:
        first: The argument after the name.
        second: The argument after that.

    Returns:
        The type and the values; None for a missing one.
    """
    if second is None and first is not None and not _TYPE.fullmatch(first):
        return None, first
    return first, second


def full_type(name: str, kind: str) -> str:
    """Returns a type name with its middle part, which is optional on the command line: `std_msgs/String`."""
    parts = name.split("/")
    return f"{parts[0]}/{kind}/{parts[1]}" if len(parts) == 2 else name


def parse(text: str | None) -> dict[str, Any]:
    """Returns the fields in YAML text; an empty dictionary for no text.

    Raises:
        WrongTypeError: The text is not YAML, or not a mapping.
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
        raise WrongTypeError(f"{text!r} contains no fields{_HINT}")
    return document.value


_HINT = "; write fields as YAML, with a space after each colon: '{linear: {x: 0.5}}'"
