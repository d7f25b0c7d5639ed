"""Converts the plugins of ROS parameter files to the form of mjplug's configuration files.

A section of such a file applies to every node whose full name matches its pattern; `/**` matches any number of names,
`/*` matches one. Parameters may be nested or dotted (`mujoco_plugins.cam.type`), and later ones override earlier ones.
Places still refer to the ROS file.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import cast

from mjplug.config.document import Document, KeyPath, Place
from mjplug.config.problem import Mark, Problem

REFERENCE_NODE = "mujoco_ros2_control_node"
"""The node name in parameter files of mujoco_ros2_control; its sections are used too."""

_REFERENCE_TYPES = "mujoco_ros2_control_plugins/"


@dataclass(frozen=True, slots=True)
class _Section:
    """The parameters of one node pattern, and their path in the file."""

    pattern: str
    path: KeyPath
    parameters: dict[str, object]

    @property
    def has_plugins(self) -> bool:
        return any(name == "mujoco_plugins" or name.startswith("mujoco_plugins.") for name in self.parameters)


def is_ros_file(value: object) -> bool:
    """Returns whether the content is that of a ROS parameter file: it contains `ros__parameters` below node names."""
    return isinstance(value, dict) and any(
        isinstance(item, dict) and ("ros__parameters" in item or is_ros_file(item)) for item in value.values()
    )


def node_names(namespace: str, node_name: str) -> tuple[str, ...]:
    """Returns the full node names whose sections apply to the server.

    Args:
        namespace: The server's namespace; empty for the root.
        node_name: The server's node name.
    """
    prefix = f"/{namespace.strip('/')}" if namespace.strip("/") else ""
    return (f"{prefix}/{node_name}", f"{prefix}/{REFERENCE_NODE}", f"/{REFERENCE_NODE}")


def matches(pattern: str, node: str) -> bool:
    """Returns whether a section's pattern matches a node.

    Args:
        pattern: A pattern such as `/**`, `/*`, `/ns/node`, `/ns/**`, or `node`, which is the same as `/node`.
        node: The node's full name.
    """
    wild = {"**": r"(?:/\w+)*", "*": r"/\w+"}
    parts = pattern.removeprefix("/").split("/")
    return re.fullmatch("".join(wild.get(part, "/" + re.escape(part)) for part in parts), node) is not None


def own_form(document: Document, nodes: Sequence[str]) -> Document:
    """Converts a ROS parameter file to a configuration document, without parameters of other nodes and programs.

    Args:
        document: The ROS parameter file.
        nodes: The server's full node names; error messages show the first one.
    """
    result = Document(document.source, {}, {(): document.places[()]}, list(document.problems))
    sections = list(_sections(document, cast(dict[str, object], document.value), (), result.problems))
    ours = [section for section in sections if any(matches(section.pattern, node) for node in nodes)]
    for section in ours:
        _take(document, section, result)
    result.problems += [_unused_gains(document, section) for section in sections if "pid_gains" in section.parameters]
    if not any(section.has_plugins for section in ours) and not result.value:
        result.problems.append(_nothing_found(document, sections, nodes[0]))
    return result


def _sections(
    document: Document, value: dict[str, object], path: KeyPath, problems: list[Problem]
) -> Iterator[_Section]:
    """Yields the sections of a file in order; namespaces may be nested mappings."""
    for key, item in value.items():
        here = (*path, key)
        if not is_ros_file({key: item}):
            message = f"{key!r} is not a section of a ROS parameter file, because it has no ros__parameters"
            hint = "" if path else "for other settings, write a configuration file that lists this file in `ros_params`"
            problems.append(Problem(message, document.places[here].key, hint))
            continue
        section = cast(dict[str, object], item)
        if "ros__parameters" not in section:
            yield from _sections(document, section, here, problems)
            continue
        parameters = section["ros__parameters"]
        if isinstance(parameters, dict):
            pattern = "/".join(str(part).strip("/") for part in here)
            yield _Section(pattern, (*here, "ros__parameters"), parameters)
        elif parameters is not None:
            place = document.places[(*here, "ros__parameters")]
            problems.append(Problem("ros__parameters must be a mapping of parameters", place.value))


def _take(document: Document, section: _Section, result: Document) -> None:
    """Adds a section's plugins to the result."""
    entries = list(_flat(section.parameters, section.path, ()))
    types = {name[0]: _value(document, path) for name, path in entries if len(name) == 2 and name[1] == "type"}
    misplaced = {
        plugin for plugin, value in types.items() if isinstance(value, str) and value.startswith(_REFERENCE_TYPES)
    }
    warned: set[str] = set()
    for name, path in entries:
        place = document.places[path]
        if name[0] == "mujoco_plugins":
            if len(name) == 1 and _value(document, path) is None:
                continue
            _store(document, path, result, ("plugins", *name[1:]))
        elif name[0] in misplaced:
            if name[0] not in warned:
                warned.add(name[0])
                message = (
                    f"the plugin {name[0]!r} should be under `mujoco_plugins:`, because mujoco_ros2_control reads it "
                    "there"
                )
                result.problems.append(Problem(message, place.key, severity="warning"))
            _store(document, path, result, ("plugins", *name))
        elif name == ("use_sim_time",):
            result.problems += _use_sim_time(_value(document, path), place)


def _flat(
    parameters: dict[str, object], path: KeyPath, prefix: tuple[str, ...]
) -> Iterator[tuple[tuple[str, ...], KeyPath]]:
    """Yields the name and the path in the file of every parameter and parameter group, groups first."""
    for key, value in parameters.items():
        name, here = (*prefix, *key.split(".")), (*path, key)
        yield name, here
        if isinstance(value, dict):
            yield from _flat(value, here, name)


def _store(document: Document, source: KeyPath, result: Document, target: KeyPath) -> None:
    """Copies a parameter, or creates a group, with its place; replaces an earlier value."""
    place = document.places[source]
    node = cast(dict[str | int, object], result.value)
    for i, part in enumerate(target[:-1]):
        child = node.get(part)
        if not isinstance(child, dict):
            child = node[part] = {}
            result.places[target[: i + 1]] = place
        node = child
    value = _value(document, source)
    result.places[target] = place
    if isinstance(value, dict):
        if not isinstance(node.get(target[-1]), dict):
            node[target[-1]] = {}
        return
    node[target[-1]] = value
    if isinstance(value, list):
        result.places |= {(*target, i): document.places[(*source, i)] for i in range(len(value))}


def _value(document: Document, path: KeyPath) -> object:
    value = document.value
    for part in path:
        value = cast(dict[str | int, object], value)[part]
    return value


def _use_sim_time(value: object, place: Place) -> list[Problem]:
    if not isinstance(value, bool):
        return [Problem("use_sim_time must be true or false", place.value)]
    if not value:
        message = "use_sim_time: false has no effect, because the server publishes the simulated time"
        return [Problem(message, place.value, severity="warning")]
    return []


def _unused_gains(document: Document, section: _Section) -> Problem:
    message = "pid_gains of the hardware component are not used; PID gains are parameters of the plugin joint_commands"
    hint = "add `plugins: {joints: {type: joint_commands, pid_gains: ...}}` with the same gains"
    return Problem(message, document.places[(*section.path, "pid_gains")].key, hint, severity="warning")


def _nothing_found(document: Document, sections: list[_Section], node: str) -> Problem:
    others = [section for section in sections if section.has_plugins]
    if not others:
        return Problem(
            "the file has no mujoco_plugins, so it adds no plugin", Mark(document.source), severity="warning"
        )
    patterns = ", ".join(f"'/{section.pattern}'" for section in others)
    message = f"no section with mujoco_plugins applies to the node {node!r}; this file has sections for {patterns}"
    name = others[0].pattern.rpartition("/")[2]
    hint = f"set `node_name: {name}`, or write '/**' here" if name.isidentifier() else "write '/**' here"
    return Problem(message, document.places[others[0].path[:-1]].key, hint)
