"""Reads a configuration from files, environment variables and the command line; reports all problems at once."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from mjplug.config import overrides
from mjplug.config.document import Document, Place, read_document
from mjplug.config.draft import Draft, Loaded
from mjplug.config.explain import show
from mjplug.config.mapping import mapping_document
from mjplug.config.origins import Origins
from mjplug.config.overrides import Option, Setting
from mjplug.config.problem import ConfigError, Mark, Problem, Source
from mjplug.config.ros_params import is_ros_file, node_names, own_form
from mjplug.config.settings import Settings
from mjplug.config.tree import Tree

__all__ = ["TOPIC", "Draft", "Loaded", "Option", "Setting", "is_model", "load", "read"]

_MODEL_SUFFIXES = (".xml", ".mjcf", ".urdf", ".xacro", ".mjb", ".mjz")
TOPIC = "topic:"
"""Beginning of the name of a model that is the text on a topic."""

_MODEL_SCHEMES = ("bundled:", "package://", TOPIC)
MAY_BE_EMPTY = ("remap", "sim", "zenoh", "ros2", "plugins", "ros_params", "model_options")
"""Settings that may be written without a value."""


def load(
    path: str | Path | Mapping[str, object] | None,
    *,
    model: str | None = None,
    sets: Sequence[str | Option | Setting] = (),
    environ: Mapping[str, str] = os.environ,
) -> Loaded:
    """Loads a configuration without validating plugin parameters; for these, use `read` and `Draft.finish`.

    Args:
        path: As for `read`.
        model: As for `read`.
        sets: As for `read`.
        environ: As for `read`.

    Raises:
        ConfigError: The configuration is invalid; the error contains all problems.
    """
    return read(path, model=model, sets=sets, environ=environ).finish()


def read(
    path: str | Path | Mapping[str, object] | None,
    *,
    model: str | None = None,
    sets: Sequence[str | Option | Setting] = (),
    environ: Mapping[str, str] = os.environ,
    defaults: Mapping[str, object] = MappingProxyType({}),
) -> Draft:
    """Reads a configuration.

    Args:
        path: A configuration file, a ROS parameter file, or a model file; or a mapping with the content of such a
            file, whose relative paths are relative to the current folder; or None for no file.
        model: The model, instead of the one in the file (`--model`).
        sets: Values such as `sim.speed=2` (`--set`), equivalent options, or settings with a value. They override
            environment variables, which override the file.
        environ: Environment variables; those such as `MJPLUG_SIM__SPEED` are used.
        defaults: Values as in a configuration file that everything else overrides.

    Raises:
        ConfigError: The file cannot be read, or is not a configuration.
    """
    options = _Options(model, sets, environ, defaults)
    main = _main(path, model)
    tree, _ = _assemble(main, [], options)
    ros_documents, problems = _ros_documents(main, Origins(tree, main.folder), tree)
    tree, wrong_options = _assemble(main, ros_documents, options)
    problems += wrong_options
    if "model" not in tree.value:
        problems.append(Problem(f"no model: {main.remedy}", Mark(main.source)))
    return Draft(tree, main.folder, problems)


def is_model(path: str | Path) -> bool:
    """Returns whether a name is that of a model, not of a configuration file."""
    text = str(path)
    return text.startswith(_MODEL_SCHEMES) or text.lower().endswith(_MODEL_SUFFIXES)


@dataclass(frozen=True, slots=True)
class _Options:
    """The parts of a configuration that do not come from files."""

    model: str | None
    sets: Sequence[str | Option | Setting]
    environ: Mapping[str, str]
    defaults: Mapping[str, object]


@dataclass(frozen=True, slots=True)
class _Main:
    """The main file.

    Attributes:
        source: The source.
        folder: The folder for relative paths.
        remedy: What to do if there is no model.
        own: The document of a configuration file.
        ros: The document of a ROS parameter file; at most one of `own` and `ros` is set.
    """

    source: Source
    folder: Path
    remedy: str
    own: Document | None = None
    ros: Document | None = None


def _main(path: str | Path | Mapping[str, object] | None, model: str | None) -> _Main:
    if path is None:
        return _Main(Source("command line"), Path.cwd(), "give a configuration file, or --model FILE")
    if not isinstance(path, Mapping) and is_model(path):
        if model is not None:
            message = f"this is a model, and --model {model} is another one; give only one of them"
            raise ConfigError([Problem(message, Mark(Source(str(path))))])
        source = Source(str(path))
        place = Place(Mark(source), Mark(source))
        folder = Path.cwd() if str(path).startswith(_MODEL_SCHEMES) else Path(path).absolute().parent
        return _Main(source, folder, "", Document(source, {"model": str(path)}, {(): place, ("model",): place}))
    if isinstance(path, Mapping):
        document, folder = mapping_document(path), Path.cwd()
    else:
        file = Path(os.path.expanduser(path))
        document, folder = read_document(file), file.absolute().parent
    source = document.source
    whole = Mark(source)
    if document.value is None:
        raise ConfigError([*document.problems, Problem("the file is empty; write at least `model: FILE`", whole)])
    if not isinstance(document.value, dict):
        message = f"a configuration must be a mapping such as `model: scene.xml`, not {show(document.value)}"
        raise ConfigError([*document.problems, Problem(message, document.places[()].value)])
    if is_ros_file(document.value):
        return _Main(source, folder, "a ROS parameter file contains no model; give --model FILE", ros=document)
    return _Main(source, folder, "write `model: FILE`, or give --model FILE", own=document)


def _assemble(main: _Main, ros_documents: Sequence[Document], options: _Options) -> tuple[Tree, list[Problem]]:
    """Merges everything into one tree; later parts override earlier ones."""
    tree = Tree(main.source)
    problems: list[Problem] = []
    if options.defaults:
        tree.merge(mapping_document(options.defaults))
    for document in [*ros_documents, *([main.own] if main.own else [])]:
        tree.merge(document)
        problems += document.problems
    for key in MAY_BE_EMPTY:
        if key in tree.value and tree.value[key] is None:
            tree.remove(key)
    problems += overrides.put_environment(tree, options.environ)
    if options.model is not None:
        overrides.put_model(tree, options.model)
    problems += overrides.put_sets(tree, options.sets)
    return tree, problems


def _ros_documents(main: _Main, origins: Origins, tree: Tree) -> tuple[list[Document], list[Problem]]:
    """Returns the ROS parameter files, converted to configuration files: the main file, and those that it lists."""
    documents = [main.ros] if main.ros else []
    problems: list[Problem] = []
    listed = tree.get(("ros_params",))
    for i in range(len(listed) if isinstance(listed, list) else 0):
        path = ("ros_params", i)
        problems += origins.missing_file(path)
        file = origins.path(path)
        if file is None:
            continue
        try:
            document = read_document(_short(file))
        except ConfigError as error:
            problems += error.problems
            continue
        if is_ros_file(document.value):
            documents.append(document)
        else:
            message = f"{tree.get(path)!r} is not a ROS parameter file, because it has no ros__parameters"
            problems.append(origins.problem(path, message))
    nodes = node_names(_text(tree, "namespace"), _text(tree, "node_name"))
    return [own_form(document, nodes) for document in documents], problems


def _short(file: Path) -> Path:
    here = Path.cwd()
    return file.relative_to(here) if file.is_relative_to(here) else file


def _text(tree: Tree, name: str) -> str:
    value = tree.get((name,))
    return value if isinstance(value, str) else str(Settings.model_fields[name].default)
