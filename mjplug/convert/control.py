"""Reads how the joints are driven: `<ros2_control>` and the older `<transmission>`."""

import math
from dataclasses import dataclass, field
from typing import Literal
from xml.etree.ElementTree import Element

from mjplug.convert.mesh_files import MeshFiles
from mjplug.convert.pid_gains import Gains, controlled_joints, read_gains
from mjplug.convert.report import Report
from mjplug.convert.robot import MAX_POSITION, Robot
from mjplug.convert.transmissions import Transmission, read_transmissions

ActuatorKind = Literal["position", "velocity", "motor"]

_KINDS: dict[str, ActuatorKind] = {"position": "position", "velocity": "velocity", "effort": "motor"}
_TRANSMISSIONS: dict[str, ActuatorKind] = {
    "PositionJointInterface": "position",
    "VelocityJointInterface": "velocity",
    "EffortJointInterface": "motor",
}


@dataclass(slots=True)
class Control:
    """The driven joints.

    Attributes:
        source: Where this comes from: `ros2_control`, `transmission`, `some transmissions`, or empty if the URDF has
            neither.
        kinds: The kind of actuator of each driven joint.
        named: Joints that the URDF names, also the passive ones.
        initial: Initial positions [rad, m].
        transmissions: The transmissions of `<ros2_control>`.
        gains: PID gains of joints and actuators.
        controlled: Joints with motors that PIDs control.
        sensors: The `<sensor>` elements of `<ros2_control>`.
    """

    source: str = ""
    kinds: dict[str, ActuatorKind] = field(default_factory=dict)
    named: set[str] = field(default_factory=set)
    initial: dict[str, float] = field(default_factory=dict)
    transmissions: list[Transmission] = field(default_factory=list)
    gains: Gains = field(default_factory=dict)
    controlled: set[str] = field(default_factory=set)
    sensors: list[Element] = field(default_factory=list)

    def is_passive(self, joint: str) -> bool:
        """Returns whether the URDF says that a joint is not driven."""
        if joint in self.kinds or not self.source:
            return False
        return self.source != "some transmissions" or joint in self.named


def read_control(root: Element, robot: Robot, files: MeshFiles, strict: bool, report: Report) -> Control:
    """Reads `<ros2_control>`, or without one the `<transmission>` elements of ROS 1.

    Args:
        root: The `<robot>`.
        robot: The robot.
        files: Finds the parameter files of PID gains.
        strict: Whether a missing file is an error.
        report: Gets notes.

    Raises:
        ModelError: A transmission or a gain is invalid.
    """
    control = Control()
    for system in root.iterfind("ros2_control"):
        control.sensors += system.findall("sensor")
        for element in system.iterfind("joint"):
            _read_joint(element, robot, control, report)
    for transmission in root.iterfind("transmission"):
        _read_transmission(transmission, robot, control, report)
    _complete(robot, control)
    control.transmissions = read_transmissions(root.iterfind("ros2_control"), robot, report)
    control.gains = read_gains(root, files, strict, report)
    controlled = controlled_joints(control.gains, root, control.transmissions)
    control.controlled = {name for name in controlled if name in control.kinds}
    control.kinds |= dict.fromkeys(control.controlled, "motor")
    return control


def _complete(robot: Robot, control: Control) -> None:
    """Ignores that joints are missing in transmissions if most are: some files have them for a gripper only."""
    free = [joint.name for joint in robot.scalar_joints if joint.mimic is None]
    if control.source == "transmission" and 2 * len([name for name in free if name in control.named]) < len(free):
        control.source = "some transmissions"


def _read_joint(element: Element, robot: Robot, control: Control, report: Report) -> None:
    name = element.get("name", "")
    if name not in robot.joints:
        report.add("warning", "<ros2_control> names a joint that does not exist", name)
        return
    control.named.add(name)
    commands = [found.get("name", "") for found in element.findall("command_interface")]
    if commands:
        control.source = "ros2_control"
    # Older hardware interfaces mark commands for PIDs by a suffix.
    plain = [command.lower().removesuffix("_pid") for command in commands]
    kind = next((_KINDS[wanted] for wanted in _KINDS if wanted in plain), None)
    if kind is not None and robot.joints[name].mimic is None:
        control.kinds[name] = kind
    elif commands and kind is None:
        report.add("loss", "command interfaces without a counterpart", name, ", ".join(commands))
    for state in element.iterfind("state_interface[@name='position']"):
        for parameter in state.iterfind("param[@name='initial_value']"):
            _read_initial(name, parameter.text, control, report)
    for parameter in element.iterfind("param[@name='initial_position']"):
        _read_initial(name, parameter.text, control, report)


def _read_initial(name: str, text: str | None, control: Control, report: Report) -> None:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if abs(value) < MAX_POSITION:
        control.initial[name] = value
    else:
        report.add("warning", f"initial position is not a number below {MAX_POSITION:g}", name, repr(text))


def _read_transmission(element: Element, robot: Robot, control: Control, report: Report) -> None:
    plugin = next(
        (found.text or "" for found in (element.find("plugin"), element.find("type")) if found is not None), ""
    )
    joints = [joint for joint in element.findall("joint") if joint.get("name") in robot.joints]
    if "Differential" in plugin or "FourBar" in plugin:
        names = ", ".join(joint.get("name", "") for joint in joints)
        report.add("loss", "transmission with coupled joints; commands are in joint space", names, plugin)
    for joint in joints:
        name = joint.get("name", "")
        texts = [
            found.text or ""
            for found in (*joint.findall("hardwareInterface"), *element.findall("actuator/hardwareInterface"))
        ]
        interfaces = [text.strip().rpartition("/")[2] for text in texts]
        kind = next((_TRANSMISSIONS[text] for text in interfaces if text in _TRANSMISSIONS), None)
        if interfaces and control.source in ("", "transmission"):
            # `JointStateInterface` alone marks a passive joint.
            control.source = "transmission"
            control.named.add(name)
            if kind is not None and robot.joints[name].mimic is None:
                control.kinds.setdefault(name, kind)
        for reduction in (*joint.findall("mechanical_reduction"), *element.findall("actuator/mechanical_reduction")):
            _note_reduction(name, reduction.text, report)


def _note_reduction(name: str, text: str | None, report: Report) -> None:
    try:
        value = float(text or "1")
    except ValueError:
        return
    if value != 1.0:
        report.add("loss", "mechanical reduction; commands and states are those of the joint", name, f"{value:g}")
