"""Configurations and values that a Python program gives, in place of YAML text."""

import os
from collections.abc import Mapping

from mjplug.config.document import Document, KeyPath, Place
from mjplug.config.problem import ConfigError, Mark, Problem, Source


def mapping_document(config: Mapping[str, object]) -> Document:
    """Returns a configuration that is given as nested mappings, as if it had been read from a file.

    Raises:
        ConfigError: It contains something that a configuration file cannot contain.
    """
    source = Source("configuration")
    value = plain_value(config, source)
    mark = Mark(source)
    return Document(source, value, {path: Place(mark, mark) for path in _paths(value, ())})


def plain_value(value: object, source: Source) -> object:
    """Returns a value in the types that YAML has: dict, list, str, int, float, bool and None.

    Tuples become lists, and paths become text. numpy's arrays and numbers become lists and numbers.

    Args:
        value: The value.
        source: Where it comes from, for errors.

    Raises:
        ConfigError: It is of another type, or a key is not text.
    """
    if value is None or type(value) in (bool, int, float, str):
        return value
    if isinstance(value, Mapping):
        for key in value:
            if not isinstance(key, str):
                raise ConfigError([Problem(f"the key {key!r} is a {type(key).__name__}; keys are text", Mark(source))])
        return {key: plain_value(item, source) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain_value(item, source) for item in value]
    if isinstance(value, os.PathLike):
        return os.fsdecode(value)
    # numpy is not imported for this.
    if callable(convert := getattr(value, "tolist", None)):
        return plain_value(convert(), source)
    raise ConfigError(
        [
            Problem(
                f"{value!r} is a {type(value).__name__}; a configuration contains text, numbers, true, false, lists "
                "and mappings",
                Mark(source),
            )
        ]
    )


def _paths(value: object, path: KeyPath) -> list[KeyPath]:
    """Returns the paths of a value and of everything in it."""
    parts: list[tuple[str | int, object]] = []
    if isinstance(value, dict):
        parts = list(value.items())
    elif isinstance(value, list):
        parts = list(enumerate(value))
    return [path, *(inner for key, item in parts for inner in _paths(item, (*path, key)))]
