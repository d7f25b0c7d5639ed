"""Finds the server's types in the ROS installation, and checks that their definitions are the same.

The message packages are imported by name; `rosidl_runtime_py` does the same but would import numpy.
"""

import importlib
import json
import os
import re
from pathlib import Path
from typing import Any

from mjplug_bridge_ros2.errors import TypeRefused

_TYPE = re.compile(
    r"(?P<package>[a-z][a-z0-9_]*)/(?P<kind>msg|srv|action)/(?P<name>[A-Z][A-Za-z0-9]*)"
    r"(?:_(?P<part>SendGoal|GetResult|FeedbackMessage))?"
)

_PARTS = {"SendGoal": "SendGoalService", "GetResult": "GetResultService", "FeedbackMessage": "FeedbackMessage"}
"""Names of the classes of derived types, in the class `Impl` of an action."""


def find_type(type_name: str, type_hash: str) -> Any:
    """Returns the class of a message, service, or derived type of an action, if the server has the same definition.

    Args:
        type_name: ROS type name, such as `std_msgs/msg/String`.
        type_hash: RIHS01 hash of the type in the server.

    Raises:
        TypeRefused: The type is not installed, or its definition differs.
    """
    ros_type = import_type(type_name)
    installed = _installed_hash(type_name)
    if installed not in (None, type_hash):
        package, _, name = type_name.partition("/")
        raise TypeRefused(
            f"the installed {package} defines {name} differently ({installed} here, {type_hash} at the server), "
            "so they cannot read each other's messages; install the same version as the server"
        )
    return ros_type


def import_type(type_name: str) -> Any:
    """Returns the class of a message, a service, or a derived type of an action, such as `…/GripperCommand_SendGoal`.

    Raises:
        TypeRefused: The type is not installed.
    """
    match = _TYPE.fullmatch(type_name)
    if match is None or (match["part"] is not None) != (match["kind"] == "action"):
        raise TypeRefused(f"{type_name!r} is not the name of a ROS message, service or part of an action")
    package, kind, name = match["package"], match["kind"], match["name"]
    ros_type = getattr(_import(package, kind), name, None)
    if ros_type is None:
        raise TypeRefused(
            f"the installed {package} has no {kind}/{name}; its version differs from the server's: "
            f"try `sudo apt update && sudo apt install {_apt(package)}`"
        )
    return ros_type if match["part"] is None else getattr(ros_type.Impl, _PARTS[match["part"]])


def _import(package: str, kind: str) -> Any:
    try:
        return importlib.import_module(f"{package}.{kind}")
    except ModuleNotFoundError as error:
        if error.name not in (package, f"{package}.{kind}"):
            raise TypeRefused(f"the package {package} cannot be imported: {error}") from error
        raise TypeRefused(
            f"the package {package} is not installed: try `sudo apt install {_apt(package)}`, then start the "
            "bridge again"
        ) from error
    except ImportError as error:
        raise TypeRefused(f"the package {package} cannot be imported: {error}") from error


def _apt(package: str) -> str:
    return f"ros-{os.environ.get('ROS_DISTRO', '$ROS_DISTRO')}-{package.replace('_', '-')}"


def _installed_hash(type_name: str) -> str | None:
    """Returns the hash that rosidl installed with the definition; None in ROS distributions before Iron."""
    # The file of an action contains the hashes of its derived types too.
    file_name = type_name.partition("_SendGoal")[0].partition("_GetResult")[0].partition("_FeedbackMessage")[0]
    for prefix in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        try:
            description = json.loads(Path(prefix, "share", f"{file_name}.json").read_text(encoding="utf-8"))
        except FileNotFoundError:
            continue
        return next(
            (entry["hash_string"] for entry in description["type_hashes"] if entry["type_name"] == type_name), None
        )
    return None
