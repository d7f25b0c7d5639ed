"""Reads the `<transmission>` elements of `<ros2_control>`."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import Element

from mjplug.convert.report import Report
from mjplug.convert.robot import SCALAR, Robot
from mjplug.errors import ModelError, did_you_mean

_TYPES = {
    "SimpleTransmission": ("simple", 1),
    "DifferentialTransmission": ("differential", 2),
    "FourBarLinkageTransmission": ("four_bar_linkage", 2),
}
"""Type of the plugin parameters, and number of joints and actuators, by the class in transmission_interface."""

_MAX_REDUCTION = 1e6


@dataclass(frozen=True, slots=True)
class Transmission:
    """A transmission.

    Attributes:
        name: Its name.
        type: `simple`, `differential` or `four_bar_linkage`.
        joints: The joints.
        actuators: The actuators.
        joint_reductions: Reduction of each joint.
        joint_offsets: Position of each joint where its actuators are at zero [rad, m].
        actuator_reductions: Reduction of each actuator.
    """

    name: str
    type: str
    joints: tuple[str, ...]
    actuators: tuple[str, ...]
    joint_reductions: tuple[float, ...]
    joint_offsets: tuple[float, ...]
    actuator_reductions: tuple[float, ...]

    def parameters(self) -> dict[str, Any]:
        """Returns the parameters for the plugins, without default values."""
        numbers = {
            "joint_reductions": (self.joint_reductions, 1.0),
            "joint_offsets": (self.joint_offsets, 0.0),
            "actuator_reductions": (self.actuator_reductions, 1.0),
        }
        return {"type": self.type, "joints": list(self.joints), "actuators": list(self.actuators)} | {
            name: list(values) for name, (values, default) in numbers.items() if any(v != default for v in values)
        }


def read_transmissions(systems: Iterable[Element], robot: Robot, report: Report) -> list[Transmission]:
    """Reads the transmissions of `<ros2_control>` elements.

    Args:
        systems: The `<ros2_control>` elements.
        robot: The robot.
        report: Gets a note for each transmission that cannot be used.

    Raises:
        ModelError: A reduction or an offset is invalid, a name is missing, or a joint does not exist.
    """
    found: list[Transmission] = []
    for system in systems:
        for element in system.iterfind("transmission"):
            transmission = _read(element, robot, report)
            if transmission is not None and _is_distinct(transmission, robot, found, report):
                found.append(transmission)
    return found


def _read(element: Element, robot: Robot, report: Report) -> Transmission | None:
    name = element.get("name") or ""
    if not name:
        raise ModelError("a <transmission> has no name")
    plugin = (element.findtext("plugin") or "").strip()
    if not plugin:
        raise ModelError(f"transmission {name!r} has no <plugin>; known: {', '.join(_TYPES)}")
    if plugin.rpartition("/")[2] not in _TYPES:
        report.add("loss", "transmission of an unknown type; commands and states are those of the joints", name, plugin)
        return None
    kind, count = _TYPES[plugin.rpartition("/")[2]]
    members = {tag: element.findall(tag) for tag in ("joint", "actuator")}
    for tag, elements in members.items():
        if len(elements) != count:
            raise ModelError(f"transmission {name!r} has {len(elements)} <{tag}>; a {kind} one needs {count}")
        names = [_name(member, tag, name) for member in elements]
        if len(set(names)) < count:
            raise ModelError(f"transmission {name!r} names the {tag} {names[0]!r} twice")
    for joint in members["joint"]:
        wanted = joint.get("name", "")
        if wanted not in robot.joints:
            raise ModelError(
                f"transmission {name!r} names the joint {wanted!r}, which the robot does not have"
                f"{did_you_mean(wanted, robot.joints)}"
            )
    joints = [joint.get("name", "") for joint in members["joint"]]
    if any(robot.joints[joint].type not in SCALAR for joint in joints):
        report.add("warning", "transmission of a joint without one coordinate, which has no effect", name)
        return None
    actuator_reductions = tuple(_reduction(member, "actuator", name) for member in members["actuator"])
    if kind == "simple" and actuator_reductions != (1.0,):
        report.add("warning", "reduction of the actuator of a simple transmission, which ros2_control ignores", name)
        actuator_reductions = (1.0,)
    return Transmission(
        name,
        kind,
        tuple(joints),
        tuple(actuator.get("name", "") for actuator in members["actuator"]),
        tuple(_reduction(member, "joint", name) for member in members["joint"]),
        tuple(_number(member, "offset", "joint", name, 0.0) for member in members["joint"]),
        actuator_reductions,
    )


def _name(element: Element, tag: str, transmission: str) -> str:
    name = element.get("name", "")
    if not name:
        raise ModelError(f"a <{tag}> of transmission {transmission!r} has no name")
    return name


def _is_distinct(transmission: Transmission, robot: Robot, others: list[Transmission], report: Report) -> bool:
    """Returns whether no name of a transmission means something else too."""
    taken = {name for other in others for name in (*other.joints, *other.actuators)}
    for name in (*transmission.joints, *transmission.actuators):
        if name in taken:
            report.add(
                "warning", "transmission left out, because another one has the same name", name, transmission.name
            )
            return False
    for name in transmission.actuators:
        if name in robot.joints:
            report.add(
                "warning",
                "transmission left out, because its actuator has the name of a joint",
                name,
                transmission.name,
            )
            return False
    return True


def _reduction(element: Element, tag: str, transmission: str) -> float:
    value = _number(element, "mechanical_reduction", tag, transmission, 1.0)
    if not 1.0 / _MAX_REDUCTION <= abs(value) <= _MAX_REDUCTION:
        raise ModelError(
            f"transmission {transmission!r}: the mechanical_reduction of {tag} {element.get('name')!r} is {value:g}; "
            f"it must not be zero, and its magnitude must be from {1.0 / _MAX_REDUCTION:g} to {_MAX_REDUCTION:g}"
        )
    return value


def _number(element: Element, part: str, tag: str, transmission: str, default: float) -> float:
    text = element.findtext(part)
    if text is None or not text.strip():
        return default
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ModelError(
            f"transmission {transmission!r}: the {part} of {tag} {element.get('name')!r} is {text.strip()!r}; "
            "it must be a number"
        )
    return value
