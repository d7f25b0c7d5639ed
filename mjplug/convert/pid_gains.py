"""Reads PID gains that a URDF contains or names.

mujoco_ros2_control reads a ROS parameter file that `<param name="pids_config_file">` of the `<hardware>` names. Older
hardware interfaces read `<param>` elements of joints with the command interfaces `position_pid` and `velocity_pid`.
"""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import yaml

from mjplug.convert.mesh_files import MeshFiles
from mjplug.convert.mjcf import Mjcf
from mjplug.convert.report import Report
from mjplug.convert.transmissions import Transmission
from mjplug.errors import ModelError

Gains = dict[str, dict[str, dict[str, Any]]]
"""Gains by interface, `position` or `velocity`, and by name of the joint or actuator."""

_PARAMETER = "pids_config_file"
_PREFIXES = {"position": ("position", "pos"), "velocity": ("velocity", "vel")}
_SUFFIXES = {"kp": "p", "ki": "i", "kd": "d", "i_max": "i_clamp_max", "max_integral_error": "i_clamp_max"}
_MAX_SIZE = 1 << 20
"""Largest size of a parameter file [bytes]."""


def gains_files(root: Element) -> list[str]:
    """Returns the names of the parameter files with gains, as the URDF gives them."""
    found = root.iterfind(f"ros2_control/hardware/param[@name='{_PARAMETER}']")
    return [name for element in found if (name := (element.text or "").strip())]


def read_gains(root: Element, files: MeshFiles, strict: bool, report: Report) -> Gains:
    """Returns the gains.

    Args:
        root: The `<robot>`.
        files: Finds the parameter files.
        strict: Whether a missing file is an error.
        report: Gets a note for a missing file.

    Raises:
        ModelError: A file contains no gains, or something else than numbers.
    """
    gains: Gains = {"position": {}, "velocity": {}}
    for name in gains_files(root):
        try:
            path = files.find(name)
        except ModelError as error:
            if strict:
                raise ModelError(f"<param name={_PARAMETER!r}>: {error}") from error
            report.add("error", f"parameter file of PID gains ({_PARAMETER})", name, str(error))
            continue
        _read_file(path, gains)
    for joint in root.iterfind("ros2_control/joint"):
        _read_joint(joint, gains)
    return gains


def controlled_joints(gains: Gains, root: Element, transmissions: list[Transmission]) -> set[str]:
    """Returns the joints that PIDs control: they accept positions or velocities, and have gains for them."""
    commands = {
        joint.get("name", ""): {_plain(found.get("name", "")) for found in joint.findall("command_interface")}
        for joint in root.iterfind("ros2_control/joint")
    }
    found = {
        name
        for name, interfaces in commands.items()
        if any(interface in interfaces and name in gains[interface] for interface in gains)
    }
    for transmission in transmissions:
        for interface, by_name in gains.items():
            if all(actuator in by_name for actuator in transmission.actuators) and all(
                interface in commands.get(joint, ()) for joint in transmission.joints
            ):
                found |= set(transmission.joints)
    return found


def used_gains(gains: Gains, mjcf: Mjcf, transmissions: list[Transmission]) -> Gains:
    """Returns the gains that have an effect.

    Those of names that the model does not have, and of servos, have none. If both sides of a transmission have gains,
    those of the actuators are used, as in mujoco_ros2_control.
    """
    kinds = {
        name: element.tag
        for element in mjcf.section("actuator")
        for name in (element.get("name"), element.get("joint"))
        if name
    }
    for transmission in transmissions:
        own = [kinds.get(joint, "") for joint in transmission.joints]
        if own and all(kind not in ("", "position", "velocity") for kind in own):
            kinds |= dict.fromkeys(transmission.actuators, "motor")
    useless = {"position": ("position", ""), "velocity": ("position", "velocity", "")}
    used: Gains = {}
    for interface, by_name in gains.items():
        kept = {name: own for name, own in by_name.items() if kinds.get(name, "") not in useless[interface]}
        for transmission in transmissions:
            if all(actuator in kept for actuator in transmission.actuators):
                kept = {name: own for name, own in kept.items() if name not in transmission.joints}
            else:
                kept = {name: own for name, own in kept.items() if name not in transmission.actuators}
        if kept:
            used[interface] = kept
    return used


def _plain(interface: str) -> str:
    """Returns the name of a command interface without the suffix that older hardware interfaces need."""
    return interface.lower().removesuffix("_pid")


def _read_file(path: Path, gains: Gains) -> None:
    try:
        if path.stat().st_size > _MAX_SIZE:
            raise ModelError(f"{path} has more than {_MAX_SIZE} bytes, too many for PID gains")
        content = yaml.safe_load(path.read_bytes())
    except (OSError, yaml.YAMLError, ValueError) as error:
        # Without the text of the error, which may quote the file.
        raise ModelError(f"{path} cannot be read as YAML with PID gains ({type(error).__name__})") from error
    found = dict(_gains_in(content))
    if not found:
        raise ModelError(f"{path} contains no pid_gains in the ros__parameters of a node")
    for interface, by_name in found.items():
        if interface not in gains or not isinstance(by_name, dict):
            raise ModelError(
                f"{path}: pid_gains contains {interface!r}; known are position and velocity, with names below"
            )
        for name, own in by_name.items():
            if not isinstance(own, dict) or not all(_is_value(value) for value in own.values()):
                raise ModelError(f"{path}: pid_gains.{interface}.{name} must contain gains and their numbers")
            gains[interface][str(name)] = {str(key): value for key, value in own.items()}


def _gains_in(content: Any) -> Iterator[tuple[Any, Any]]:
    """Yields `position` and `velocity` of every node in a ROS parameter file."""
    if not isinstance(content, dict):
        return
    parameters = [node.get("ros__parameters") for node in content.values() if isinstance(node, dict)]
    for own in parameters:
        if isinstance(own, dict) and isinstance(own.get("pid_gains"), dict):
            yield from own["pid_gains"].items()


def _is_value(value: Any) -> bool:
    return isinstance(value, str | bool) or (isinstance(value, int | float) and not math.isnan(value))


def _read_joint(joint: Element, gains: Gains) -> None:
    interfaces = {found.get("name", "").lower() for found in joint.findall("command_interface")}
    parameters: Mapping[str, str] = {found.get("name", ""): found.text or "" for found in joint.findall("param")}
    for interface, prefixes in _PREFIXES.items():
        if f"{interface}_pid" not in interfaces:
            continue
        own: dict[str, Any] = {}
        for prefix in prefixes:
            for suffix, gain in _SUFFIXES.items():
                text = parameters.get(f"{prefix}_{suffix}")
                if text is not None:
                    own[gain] = _number(text, f"{prefix}_{suffix}", joint.get("name", ""))
        if "i_clamp_max" in own:
            own["i_clamp_min"] = -own["i_clamp_max"]
        if own:
            gains[interface].setdefault(joint.get("name", ""), own)


def _number(text: str, parameter: str, joint: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ModelError(f"{parameter} of joint {joint!r} in <ros2_control> is {text!r}; it must be a number")
    return value
