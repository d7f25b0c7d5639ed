"""Converts pydantic's validation errors to problems with a sentence and the place of the invalid value."""

import re
from collections.abc import Mapping, Sequence
from typing import cast

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from mjplug.config.document import KeyPath
from mjplug.config.known_keys import known_keys
from mjplug.config.problem import Problem
from mjplug.config.scalar import ros_scalar
from mjplug.config.tree import Tree
from mjplug.errors import did_you_mean

_KEY = "[key]"
_MAX_SHOWN_LENGTH = 60

_WORDS = {
    "model_type": "Input should be a mapping",
    "dict_type": "Input should be a mapping",
    "mapping_type": "Input should be a mapping",
    "model_attributes_type": "Input should be a mapping",
    "tuple_type": "Input should be a list",
    "list_type": "Input should be a list",
    "set_type": "Input should be a list",
    "bool_type": "Input should be true or false",
    "string_type": "Input should be text",
    "int_type": "Input should be a whole number",
    "float_type": "Input should be a number",
}
"""Messages in YAML's terms, by the type of pydantic's error."""


def explain(error: ValidationError, tree: Tree, prefix: KeyPath, model: type[BaseModel] | None) -> list[Problem]:
    """Returns one problem for each invalid value.

    Args:
        error: The validation error.
        tree: The values with their places.
        prefix: The path of the validated mapping.
        model: The model of the validation; if given, the message about an unknown key lists the known keys.
    """
    groups: dict[tuple[KeyPath, bool], list[ErrorDetails]] = {}
    for details in error.errors(include_url=False):
        path, is_key = _locate(details, tree, prefix)
        groups.setdefault((path, is_key), []).append(details)
    return [_problem(path, is_key, group, tree, model) for (path, is_key), group in groups.items()]


def dotted(path: KeyPath) -> str:
    """Returns a path in dotted form: `plugins.cam.topics[0]`."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{_short(part)}" for part in path)
    return text.removeprefix(".")


def show(value: object) -> str:
    """Returns a short description of a value for error messages, in YAML's terms."""
    if isinstance(value, Mapping):
        return "a mapping"
    if isinstance(value, list | tuple):
        return "a list" if value else "an empty list"
    if value is None:
        return "nothing"
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    return _short(text)


def _short(text: str) -> str:
    return text if len(text) <= _MAX_SHOWN_LENGTH else f"{text[: _MAX_SHOWN_LENGTH - 1]}…"


def _locate(details: ErrorDetails, tree: Tree, prefix: KeyPath) -> tuple[KeyPath, bool]:
    """Returns the path of the invalid value, and whether the key is invalid instead of the value.

    The names of union members in pydantic's location are skipped, because they are not part of the file.
    """
    path, location = prefix, details["loc"]
    for i, part in enumerate(location):
        node = tree.get(path)
        there = isinstance(node, dict) and part in node
        item = isinstance(node, list) and isinstance(part, int) and part < len(node)
        if there or item or (details["type"] == "missing" and i == len(location) - 1):
            path = (*path, part)
    return path, details["type"] == "extra_forbidden" or location[-1:] == (_KEY,)


def _problem(
    path: KeyPath, is_key: bool, group: list[ErrorDetails], tree: Tree, model: type[BaseModel] | None
) -> Problem:
    first = group[0]
    kinds = {details["type"] for details in group}
    place = tree.place(path)
    mark = place.key if is_key else place.value
    if kinds == {"extra_forbidden"}:
        known = sorted(set(known_keys(model, first["loc"][:-1]))) if model else []
        listing = f"; known: {', '.join(known)}" if known else ""
        return Problem(f"{dotted(path)}: unknown key{listing}", mark, _suggestion(str(path[-1]), known))
    if "missing" in kinds:
        return Problem(
            f"{dotted(path)}: required, but not given", tree.place(path[:-1]).key, _instance_hint(path, tree)
        )
    value = path[-1] if is_key else tree.get(path)
    message, expected = _combined(group)
    actual = (
        ""
        if any(details["type"] in ("value_error", "assertion_error") for details in group)
        else f", not {show(value)}"
    )
    hint = _suggestion(value, expected) if isinstance(value, str) else ""
    return Problem(f"{dotted(path)}: {message}{actual}", mark, hint or _quoting_hint(kinds, value, place.plain))


def _combined(group: list[ErrorDetails]) -> tuple[str, list[str]]:
    """Joins the messages of a union's members; returns the message and the allowed words."""
    parts: list[str] = []
    expected: list[str] = []
    # pydantic also reports a list with invalid items as too short, because it does not count these items.
    for details in [d for d in group if d["type"] != "too_short"] or group:
        text = _WORDS.get(
            details["type"], details["msg"].removeprefix("Value error, ").removeprefix("Assertion failed, ")
        )
        # Removes Python's type and the words "after validation" from pydantic's message.
        text = re.sub(r"^(?:Tuple|List) (should have at \w+ \d+ items?).*", r"Value \1", text)
        if details["type"] in ("literal_error", "enum"):
            expected += re.findall("'([^']*)'", str(details.get("ctx", {}).get("expected", "")))
        if text not in parts:
            parts.append(text)
    start = "Input should be "
    if all(part.startswith(start) for part in parts):
        return start + " or ".join(part.removeprefix(start) for part in parts), expected
    return "; or ".join(parts), expected


def _suggestion(word: str, known: Sequence[str]) -> str:
    return did_you_mean(word, known).removeprefix(", ") if len(word) <= _MAX_SHOWN_LENGTH else ""


def _quoting_hint(kinds: set[str], value: object, plain: str | None) -> str:
    """Returns a hint if only quotes are missing or superfluous, or if the brackets of a list are missing."""
    scalar = isinstance(value, bool | int | float | str)
    if "string_type" in kinds and plain and scalar:
        return f'for text, write "{plain}" with the quotes'
    if kinds & {"float_type", "int_type", "bool_type"} and plain is None and isinstance(value, str):
        typed = ros_scalar(value)
        right = (
            ("bool_type" in kinds and isinstance(typed, bool))
            or ("int_type" in kinds and type(typed) is int)
            or ("float_type" in kinds and type(typed) in (int, float))
        )
        return "leave out the quotes" if right else ""
    if kinds & {"tuple_type", "list_type"} and scalar:
        return f"write [{plain or value}] for a list with one item"
    return ""


def _instance_hint(path: KeyPath, tree: Tree) -> str:
    """Returns a hint for an entry under `plugins` that an option has created, probably by a misspelt name."""
    if len(path) != 3 or path[0] != "plugins" or path[2] != "type":
        return ""
    if tree.place(path[:2]).value.source.lines:
        return ""
    others = cast(dict[str, object], tree.get(("plugins",)))
    return _suggestion(str(path[1]), [name for name in others if name != path[1]])
