"""Finds the server's types in this ROS installation, and makes sure that they are the same.

The message packages are imported by name, as `rosidl_runtime_py` does it, which would bring numpy along.
"""

import importlib
import json
import os
import re
from pathlib import Path
from typing import Any

from mjplug_bridge_ros2.errors import TypeRefused

_TYPE = re.compile(r"(?P<package>[a-z][a-z0-9_]*)/(?P<kind>msg|srv)/(?P<name>[A-Z][A-Za-z0-9]*)")


def find_type(type_name: str, type_hash: str) -> Any:
    """Returns the class of a message or service, if it is the one that the server means.

    Args:
        type_name: Such as `std_msgs/msg/String`.
        type_hash: The RIHS01 hash that the server has for it.

    Raises:
        TypeRefused: It is not installed, or its definition is another one.
    """
    found = import_type(type_name)
    installed = _installed_hash(type_name)
    if installed not in (None, type_hash):
        package, _, name = type_name.partition("/")
        raise TypeRefused(
            f"the installed {package} defines {name} differently ({installed} here, {type_hash} at the server), "
            "so that neither could read what the other writes; install the version that the server has"
        )
    return found


def import_type(type_name: str) -> Any:
    """Returns the class of a message or service.

    Raises:
        TypeRefused: It is not installed.
    """
    match = _TYPE.fullmatch(type_name)
    if match is None:
        raise TypeRefused(f"{type_name!r} is not the name of a ROS message or service")
    package, kind, name = match["package"], match["kind"], match["name"]
    found = getattr(_import(package, kind), name, None)
    if found is None:
        raise TypeRefused(
            f"the installed {package} has no {kind}/{name}; it is another version than the server's: "
            f"try `sudo apt update && sudo apt install {_apt(package)}`"
        )
    return found


def _import(package: str, kind: str) -> Any:
    try:
        return importlib.import_module(f"{package}.{kind}")
    except ModuleNotFoundError as error:
        if error.name not in (package, f"{package}.{kind}"):
            raise TypeRefused(f"the package {package} does not work here: {error}") from error
        raise TypeRefused(
            f"the package {package} is not installed here: try `sudo apt install {_apt(package)}`, then start the "
            "bridge again"
        ) from error
    except ImportError as error:
        raise TypeRefused(f"the package {package} does not work here: {error}") from error


def _apt(package: str) -> str:
    return f"ros-{os.environ.get('ROS_DISTRO', '$ROS_DISTRO')}-{package.replace('_', '-')}"


def _installed_hash(type_name: str) -> str | None:
    """Returns the hash that rosidl wrote next to the definition; None before Iron, which had no hashes."""
    for prefix in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        try:
            told = json.loads(Path(prefix, "share", f"{type_name}.json").read_text(encoding="utf-8"))
        except FileNotFoundError:
            continue
        return next((entry["hash_string"] for entry in told["type_hashes"] if entry["type_name"] == type_name), None)
    return None
