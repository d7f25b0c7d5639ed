"""Compares messages field by field."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from mjplug_schemas.message import Message

MOST_DIFFERENCES = 10
"""Maximum number of differences in an error."""


def assert_message(
    actual: Message, expected: Message | Mapping[str, Any], *, rel: float = 1e-9, abs: float = 1e-12
) -> None:
    """Checks that a message has the expected fields.

    Numbers may differ by `rel` times the larger one, or by `abs`. NaN equals NaN. Everything else must be equal.

    Args:
        actual: The message.
        expected: A message of the same type; or nested mappings, such as `{"twist": {"linear": {"x": 0.5}}}`, of which
            only the given fields are compared. Sequences must have the same length.
        rel: Relative tolerance.
        abs: Absolute tolerance, in the unit of the field.

    Raises:
        AssertionError: Fields differ; the text contains their names and values.
    """
    __tracebackhide__ = True
    if isinstance(expected, Message) and type(actual) is not type(expected):
        raise AssertionError(f"the message is {_kind(actual)}, not {_kind(expected)}")
    found = list(_differences("", actual, expected, rel, abs))
    if found:
        more = [f"… and {len(found) - MOST_DIFFERENCES} more"] if len(found) > MOST_DIFFERENCES else []
        raise AssertionError("\n".join([f"{_kind(actual)}:", *found[:MOST_DIFFERENCES], *more]))


def _differences(path: str, actual: Any, expected: Any, rel: float, abs: float) -> Iterator[str]:
    """Yields a line for each field that differs."""
    if isinstance(actual, Message) and isinstance(expected, Message | Mapping):
        fields = type(actual).model_fields
        wanted = expected if isinstance(expected, Mapping) else {name: getattr(expected, name) for name in fields}
        for name, value in wanted.items():
            if name not in fields:
                yield f"  {path}{name}: {_kind(actual)} has no such field; fields: {', '.join(fields)}"
            else:
                yield from _differences(f"{path}{name}.", getattr(actual, name), value, rel, abs)
        return
    where = path.removesuffix(".")
    if _is_sequence(actual) and _is_sequence(expected):
        if len(actual) != len(expected):
            yield f"  {where}: {len(actual)} values, expected {len(expected)}"
            return
        for index, (one, other) in enumerate(zip(actual, expected, strict=True)):
            yield from _differences(f"{where}[{index}].", one, other, rel, abs)
    elif not _equal(actual, expected, rel, abs):
        yield f"  {where}: {actual!r}, expected {expected!r}"


def _equal(actual: Any, expected: Any, rel: float, abs: float) -> bool:
    numbers = (int, float, np.integer, np.floating)
    if isinstance(actual, numbers) and isinstance(expected, numbers) and not isinstance(actual, bool):
        both_nan = math.isnan(actual) and math.isnan(expected)
        return both_nan or math.isclose(actual, expected, rel_tol=rel, abs_tol=abs)
    return bool(actual == expected)


def _is_sequence(value: Any) -> bool:
    # Pixels and other bytes are compared as a whole.
    return isinstance(value, Sequence | np.ndarray) and not isinstance(value, str | bytes | bytearray | memoryview)


def _kind(message: Message) -> str:
    return message.TYPE
