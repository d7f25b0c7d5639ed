"""The parameters of the bridge's node."""

import math
import re
from dataclasses import dataclass
from pathlib import Path
from re import Pattern
from typing import Any

from mjplug_bridge_ros2.errors import SettingsError
from mjplug_bridge_ros2.naming import Naming, is_full_name

# As a default, a list without entries would be taken for a list of bytes.
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
    """What the parameters say.

    Attributes:
        connect: Zenoh endpoints to connect to; the first that answers is taken.
        zenoh_config: A Zenoh configuration file, for TLS and credentials; None for none.
        server: Full name of the one server to map; empty for all.
        naming: What is mapped, and to which names.
        service_timeout: How long a service call may take [s].
    """

    connect: tuple[str, ...]
    zenoh_config: Path | None
    server: str
    naming: Naming
    service_timeout: float


def read_settings(node: Any) -> Settings:
    """Declares the parameters on a node and returns what they say.

    Raises:
        SettingsError: Some are wrong.
    """
    problems: list[str] = []
    values = {name: _declare(node, name, default, problems) for name, default in DEFAULTS.items()}
    config, server, namespace = values["zenoh_config"], values["server"], values["namespace"]
    if config and not Path(config).is_file():
        problems.append(f"zenoh_config: there is no file {config!r}")
    for name, value in (("server", server), ("namespace", namespace)):
        if value and not is_full_name(value):
            problems.append(f"{name}: {value!r} is not a full ROS name; it looks like /robot1")
    if not (math.isfinite(values["service_timeout"]) and values["service_timeout"] > 0.0):
        problems.append(f"service_timeout: it must be above 0 s, not {values['service_timeout']!r}")
    naming = Naming(
        _patterns("allow", values["allow"], problems),
        _patterns("deny", values["deny"], problems),
        namespace,
        _remap(values["remap"], problems),
    )
    connect = tuple(filter(None, values["connect"]))
    if not (connect or config):
        problems.append("connect: it must have an endpoint, such as tcp/127.0.0.1:7447")
    if problems:
        raise SettingsError("\n".join(problems))
    return Settings(connect, Path(config) if config else None, server, naming, values["service_timeout"])


def _declare(node: Any, name: str, default: Any, problems: list[str]) -> Any:
    """Declares a parameter and returns its value, or the default if it is wrong."""
    try:
        node.declare_parameter(name, default)
    except Exception as error:
        # Which exception says that a value has the wrong type differs between distributions.
        if isinstance(default, float) and _declared(node, name, round(default)):
            return float(node.get_parameter(name).value)
        problems.append(f"{name}: {error}")
        return default
    try:
        value = node.get_parameter(name).value
    except Exception:
        # ROS takes `[]` for a parameter without a value, and some versions raise when it is read.
        value = None
    if value is None:
        if isinstance(default, list):
            return []
        problems.append(f"{name}: it has no value")
        return default
    return value


def _declared(node: Any, name: str, default: int) -> bool:
    """Declares a parameter as an integer; ROS reads 600 as one, and does not take it for a double."""
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
            problems.append(f"remap: {rule!r} must be two full names with := between them, such as /scan:=/robot1/scan")
    return remap
