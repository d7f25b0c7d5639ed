"""The parameters of the bridge's node."""

import math
import re
from dataclasses import dataclass
from pathlib import Path
from re import Pattern
from typing import Any

from mjplug_bridge_ros2.errors import SettingsError
from mjplug_bridge_ros2.naming import Naming, is_full_name

# ROS treats an empty list as a list of bytes, so the default of an empty list of texts is [""].
_NONE = [""]

DEFAULTS: dict[str, Any] = {
    "connect": ["tcp/127.0.0.1:7447"],
    "zenoh_config": "",
    "server": "",
    "allow": [".*"],
    "deny": _NONE,
    "namespace": "",
    "remap": _NONE,
    "service_timeout": 600.0,
}


@dataclass(frozen=True)
class Settings:
    """The values of the parameters.

    Attributes:
        connect: Zenoh endpoints to connect to; the first one that answers is used.
        zenoh_config: Zenoh configuration file, for example for TLS and credentials; None if not set.
        server: Full name of the server to map; empty: all servers.
        naming: Which interfaces are mapped, and their ROS names.
        service_timeout: Timeout of a service call [s].
    """

    connect: tuple[str, ...]
    zenoh_config: Path | None
    server: str
    naming: Naming
    service_timeout: float


def read_settings(node: Any) -> Settings:
    """Declares the parameters on a node and returns their values.

    Raises:
        SettingsError: A value is invalid.
    """
    problems: list[str] = []
    values = {name: _declare(node, name, default, problems) for name, default in DEFAULTS.items()}
    config, server, namespace = values["zenoh_config"], values["server"], values["namespace"]
    if config and not Path(config).is_file():
        problems.append(f"zenoh_config: the file {config!r} does not exist")
    for name, value in (("server", server), ("namespace", namespace)):
        if value and not is_full_name(value):
            problems.append(f"{name}: {value!r} is not a full ROS name such as /robot1")
    if not (math.isfinite(values["service_timeout"]) and values["service_timeout"] > 0.0):
        problems.append(f"service_timeout: the value must be above 0 s, not {values['service_timeout']!r}")
    naming = Naming(
        _patterns("allow", values["allow"], problems),
        _patterns("deny", values["deny"], problems),
        namespace,
        _remap(values["remap"], problems),
    )
    connect = tuple(filter(None, values["connect"]))
    if not (connect or config):
        problems.append("connect: add an endpoint, such as tcp/127.0.0.1:7447")
    if problems:
        raise SettingsError("\n".join(problems))
    return Settings(connect, Path(config) if config else None, server, naming, values["service_timeout"])


def _declare(node: Any, name: str, default: Any, problems: list[str]) -> Any:
    """Declares a parameter and returns its value, or the default if the value is invalid."""
    try:
        node.declare_parameter(name, default)
    except Exception as error:
        # The exception for a value of the wrong type depends on the ROS distribution.
        if isinstance(default, float) and _declared(node, name, round(default)):
            return float(node.get_parameter(name).value)
        problems.append(f"{name}: {error}")
        return default
    try:
        value = node.get_parameter(name).value
    except Exception:
        # ROS treats `[]` as a parameter without a value, and some versions raise an error when it is read.
        value = None
    if value is None:
        if isinstance(default, list):
            return []
        problems.append(f"{name}: the parameter has no value")
        return default
    return value


def _declared(node: Any, name: str, default: int) -> bool:
    """Declares a parameter as an integer, because ROS reads 600 as an integer and refuses it for a double."""
    try:
        node.declare_parameter(name, default)
    except Exception:
        return False
    return True


def _patterns(name: str, texts: list[str], problems: list[str]) -> tuple[Pattern[str], ...]:
    patterns = []
    for text in filter(None, texts):
        try:
            patterns.append(re.compile(text))
        except re.error as error:
            problems.append(f"{name}: {text!r} is not a regular expression: {error}")
    return tuple(patterns)


def _remap(rules: list[str], problems: list[str]) -> dict[str, str]:
    remap: dict[str, str] = {}
    for rule in filter(None, rules):
        old, _, new = rule.partition(":=")
        if is_full_name(old) and is_full_name(new):
            remap[old] = new
        else:
            problems.append(f"remap: {rule!r} must be two full names separated by :=, such as /scan:=/robot1/scan")
    return remap
