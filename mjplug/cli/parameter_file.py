"""ROS parameter files as `mjplug param dump` writes and `mjplug param load` reads them."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from mjplug.cli.yaml_text import block
from mjplug.client import ClientError, WrongTypeError
from mjplug.config.document import parse_document, read_document
from mjplug.config.problem import ConfigError, Source

_PARAMETERS = "ros__parameters"
_ALL = "/**"


def written(node: str, values: Mapping[str, Any]) -> Iterator[str]:
    """Yields the lines of a file with the parameters of one node.

    Args:
        node: Its full name.
        values: Values by full name: `sim.speed` is `speed` in the section `sim`.
    """
    sections: dict[str, Any] = {}
    for name, value in values.items():
        section = sections
        *above, last = name.split(".")
        for part in above:
            section = section.setdefault(part, {})
        section[last] = value
    yield from block({node: {_PARAMETERS: sections}})


def read(file: Path, node: str, wildcard: bool = True) -> dict[str, Any]:
    """Returns the parameters for a node from a file, by full name.

    Args:
        file: The file.
        node: The node's full name.
        wildcard: Whether to include parameters for all nodes (`/**`).

    Raises:
        ConfigError: The file cannot be read, or is not YAML.
        ClientError: The file contains no parameters for this node.
    """
    document = read_document(file)
    if document.problems:
        raise ConfigError(document.problems)
    tree = document.value if isinstance(document.value, dict) else {}
    namespace, _, last = node.rpartition("/")
    # In the order in which rcl applies them: later entries override earlier ones.
    names = [*([_ALL] if wildcard else []), *([last] if not namespace else []), node]
    found: dict[str, Any] = {}
    for name in names:
        section = tree.get(name)
        parameters = section.get(_PARAMETERS) if isinstance(section, dict) else None
        if isinstance(parameters, dict):
            found |= dict(_flat("", parameters))
    if not found:
        raise ClientError(f"{file} contains no parameters for {node}, only for: {', '.join(map(str, tree)) or 'none'}")
    return found


def parameter_value(text: str) -> Any:
    """Returns the value of YAML text: a bool, a number, a string, or a list of values of one of these types.

    Raises:
        WrongTypeError: The value has another type.
    """
    try:
        document = parse_document(text, Source("the value"))
    except ConfigError as error:
        raise WrongTypeError(error.problems[0].message) from None
    if document.problems:
        raise WrongTypeError(document.problems[0].message)
    if document.value is None or isinstance(document.value, dict):
        raise WrongTypeError(f"{text!r} is not the value of a parameter; write a bool, a number, a string, or a list")
    return document.value


def _flat(prefix: str, section: Mapping[Any, Any]) -> Iterator[tuple[str, Any]]:
    for key, value in section.items():
        if isinstance(value, dict):
            yield from _flat(f"{prefix}{key}.", value)
        else:
            yield f"{prefix}{key}", value
