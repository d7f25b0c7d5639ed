"""Values from the command line and from environment variables, which override those of files."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import cast

from mjplug.config.document import Place, parse_document, unquoted
from mjplug.config.explain import dotted, show
from mjplug.config.mapping import plain_value
from mjplug.config.problem import ConfigError, Mark, Problem, Source
from mjplug.config.section import Section
from mjplug.config.settings import Settings
from mjplug.config.tree import NotASectionError, Tree
from mjplug.errors import did_you_mean
from mjplug_schemas.names import NAMESPACE

PREFIX = "MJPLUG_"

ROS_DOMAIN = "ROS_DOMAIN_ID"
"""The environment variable that ROS 2 nodes use; it is the default of `ros2.domain_id`."""

RESERVED = ("MJPLUG_CONNECT", "MJPLUG_LOG")
"""Prefixes of environment variables that are not settings."""


@dataclass(frozen=True, slots=True)
class Option:
    """A value from a command line option other than `--set`.

    Attributes:
        typed: The option as the user typed it, for error messages: `--speed 2`.
        meant: The equivalent argument of `--set`: `sim.speed=2`.
    """

    typed: str
    meant: str


@dataclass(frozen=True, slots=True)
class Setting:
    """A value that a Python program gives.

    Attributes:
        given: The argument, for error messages: `speed='fast'`.
        name: The setting: `sim.speed`.
        value: The value.
    """

    given: str
    name: str
    value: object


def put_model(tree: Tree, model: str) -> None:
    """Sets the model of the command line."""
    _put(tree, ["model"], model, Source(f"--model {model}"), model)


def put_environment(tree: Tree, environ: Mapping[str, str]) -> list[Problem]:
    """Sets values from environment variables such as `MJPLUG_SIM__SPEED=2`; `__` separates levels.

    ROS_DOMAIN_ID is used only if no file sets `ros2.domain_id`.

    Returns:
        The problems of the variables.
    """
    problems: list[Problem] = []
    ros_domain = environ.get(ROS_DOMAIN, "")
    if ros_domain and isinstance(tree.get(("ros2",)), dict | None) and tree.get(("ros2", "domain_id")) is None:
        problems += _put_text(tree, ["ros2", "domain_id"], ros_domain, Source(f"environment {ROS_DOMAIN}"))
    for name, text in sorted(environ.items()):
        if not name.startswith(PREFIX) or name.startswith(RESERVED):
            continue
        source = Source(f"environment {name}")
        path = _spelled_as_there(tree, name.removeprefix(PREFIX).split("__"))
        if path[0] not in Settings.model_fields:
            suggestion = did_you_mean(name, list(_variables())).removeprefix(", ")
            problems.append(Problem("there is no setting with this name", Mark(source), suggestion))
        else:
            problems += _put_text(tree, path, text, source)
    return problems


def put_sets(tree: Tree, sets: Sequence[str | Option | Setting]) -> list[Problem]:
    """Sets values from arguments of `--set`, such as `sim.speed=2`, and from other options; later ones override.

    Returns:
        The problems of the arguments.
    """
    problems: list[Problem] = []
    for given in sets:
        if isinstance(given, Setting):
            problems += _put_setting(tree, given)
            continue
        option = Option(f"--set {given}", given) if isinstance(given, str) else given
        source = Source(option.typed)
        name, equals, text = option.meant.partition("=")
        path = name.strip().split(".")
        if not equals or not all(path):
            problems.append(Problem("it is not path=value; write for example sim.speed=2", Mark(source)))
        else:
            problems += _put_text(tree, path, text, source)
    return problems


def _put_setting(tree: Tree, setting: Setting) -> list[Problem]:
    source, path = Source(setting.given), setting.name.split(".")
    if not all(path):
        return [Problem(f"{setting.name!r} is not the name of a setting, such as sim.speed", Mark(source))]
    try:
        return _put(tree, path, plain_value(setting.value, source), source)
    except ConfigError as error:
        return list(error.problems)


def _put_text(tree: Tree, path: Sequence[str], text: str, source: Source) -> list[Problem]:
    try:
        plain = None if text.startswith(("'", '"')) else text
        return _put(tree, path, _read(text, source), source, plain)
    except ConfigError as error:
        return list(error.problems)


def _put(tree: Tree, path: Sequence[str], value: object, source: Source, plain: str | None = None) -> list[Problem]:
    mark = Mark(source)
    try:
        tree.put(path, value, Place(mark, mark, plain))
    except NotASectionError as error:
        return [
            Problem(f"{dotted(error.path)} is {show(error.value)}; it cannot contain {path[len(error.path)]!r}", mark)
        ]
    return []


def _read(text: str, source: Source) -> object:
    """Parses a value: lists, mappings and quoted text as YAML, everything else by the rules for unquoted scalars."""
    # `{ns}/scan` is a name, which needs quotes only in a file, not on the command line.
    if text.lstrip().startswith(("[", "{", '"', "'", "!")) and not text.lstrip().startswith(NAMESPACE):
        document = parse_document(text, source)
        if document.problems:
            raise ConfigError(document.problems)
        return document.value
    # `--set namespace=` means empty text; in a file, an empty value would be null.
    return unquoted(text.strip()) if text.strip() else ""


def _spelled_as_there(tree: Tree, parts: Sequence[str]) -> list[str]:
    """Returns the parts of a variable's name, spelled like existing keys, or in lower case if there is no such key."""
    path: list[str] = []
    for part in parts:
        node = tree.get(tuple(path))
        keys = cast(Mapping[str, object], node) if isinstance(node, dict) else {}
        path.append(next((key for key in keys if key.lower() == part.lower()), part.lower()))
    return path


def _variables() -> Iterator[str]:
    """Yields the names of all environment variables, without those for plugins."""
    for name, field in Settings.model_fields.items():
        yield f"{PREFIX}{name}".upper()
        if isinstance(field.annotation, type) and issubclass(field.annotation, Section):
            yield from (f"{PREFIX}{name}__{inner}".upper() for inner in field.annotation.model_fields)
