"""Configurations and values that a Python program gives instead of YAML text."""

import os
from collections.abc import Mapping

from mjplug.config.document import Document, KeyPath, Place
from mjplug.config.problem import ConfigError, Mark, Problem, Source


def mapping_document(config: Mapping[str, object]) -> Document:
    """Returns the document of a configuration that is given as nested mappings.

    Raises:
        ConfigError: It contains a value that a configuration file cannot contain.
    """
    source = Source("configuration")
    value = plain_value(config, source)
    mark = Mark(source)
    return Document(source, value, {path: Place(mark, mark) for path in _paths(value, ())})


def plain_value(value: object, source: Source) -> object:
    """Converts a value to YAML's types: dict, list, str, int, float, bool and None.

    Tuples become lists, and paths become text. numpy's arrays and numbers become lists and numbers.

    Args:
        value: The value.
        source: The source of the value, for the error message.

    Raises:
        ConfigError: The value has another type, or a key is not text.
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
    # numpy's types are detected without importing numpy.
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
