"""Chooses the actuators of a robot, their gains and limits, and the damping and armature of its joints.

The rules were tuned on 21 robots: a position servo holds its pose, and a step of 0.2 rad overshoots by less than 5 %.
"""

import math
from collections.abc import Collection
from dataclasses import dataclass
from xml.etree.ElementTree import SubElement

from mjplug.convert.base import is_caster
from mjplug.convert.control import ActuatorKind, Control
from mjplug.convert.measure import Measured
from mjplug.convert.mjcf import Mjcf
from mjplug.convert.options import ConversionOptions
from mjplug.convert.report import Report
from mjplug.convert.robot import Joint, Robot
from mjplug.convert.rotations import exactly

GRAVITY = 9.81

_MAX_EFFORT = 5000.0
"""Effort limits above this mean "unlimited" in existing files [N m, N]."""

_TIMESTEP = 0.002
_ERROR = {"hinge": 0.05, "slide": 0.005}
"""Error at which a servo applies its largest force [rad, m]."""

_FRICTION_ERROR = 0.02
"""Error that damping and friction may cause [rad, m]."""

_VELOCITY_ERROR = 0.02
"""Part of the velocity limit at which a velocity servo applies its largest force."""

_DEFAULT_VELOCITY = 10.0
_MIN_SPEED = 3.0
"""Speed that a joint reaches against its damping with a guessed effort limit [rad/s, m/s]."""

_WHEEL_LEVER = 0.1


@dataclass(frozen=True, slots=True)
class Drive:
    """The dynamics of a joint and its actuator.

    Attributes:
        joint: Name of the joint.
        kind: Kind of the actuator; empty for a passive joint.
        effort: Largest force or torque [N, N m].
        armature: Inertia of the rotor [kg m², kg].
        damping: Damping [N m s/rad, N s/m].
        kp: Gain of a position servo [N m/rad, N/m].
        kv: Damping of a position servo, or gain of a velocity servo [N m s/rad, N s/m].
        gravcomp: Whether the servo, or the PID of the motor, is helped by a compensation of gravity.
    """

    joint: str
    kind: ActuatorKind | None
    effort: float
    armature: float
    damping: float
    kp: float = 0.0
    kv: float = 0.0
    gravcomp: bool = False


@dataclass(frozen=True, slots=True)
class DriveRules:
    """Computes the drives.

    Attributes:
        robot: The robot.
        control: How the joints are driven.
        options: The options.
        wheels: The wheels.
        measured: Inertias and gravity torques.
        mass: Mass of the robot [kg].
        free: Whether the robot stands freely.
        wheel_radius: Radius of the largest wheel; 0 without wheels [m].
        report: The report.
    """

    robot: Robot
    control: Control
    options: ConversionOptions
    wheels: list[Joint]
    measured: Measured
    mass: float
    free: bool
    wheel_radius: float
    report: Report

    def drives(self) -> list[Drive]:
        """Returns the drive of each joint with one coordinate, in the order of the tree."""
        return [self._drive(joint) for joint in self.robot.scalar_joints]

    def kind_of(self, joint: Joint) -> ActuatorKind | None:
        """Returns the kind of a joint's actuator; None if it is passive."""
        wanted = self.options.actuators
        if joint.mimic is not None or wanted == "none":
            return None
        if self.control.is_passive(joint.name):
            # A joint that others follow is the motor of a gripper, which some files do not list.
            leads = any(other.mimic and other.mimic.joint == joint.name for other in self.robot.scalar_joints)
            if not leads or joint.name in self.control.named:
                return None
        kind = self.control.kinds.get(joint.name)
        if kind is not None:
            return kind if wanted == "auto" else wanted
        if joint.type == "continuous" and is_caster(self.robot, joint):
            return None
        if wanted != "auto":
            return wanted
        return "velocity" if joint in self.wheels and self.free else "position"

    def _drive(self, joint: Joint) -> Drive:
        kind = self.kind_of(joint)
        inertia, gravity = self.measured.inertia[joint.name], self.measured.gravity[joint.name]
        effort = self._effort(joint, kind, inertia, gravity)
        slide = joint.type == "prismatic"
        armature = 0.1 * inertia if slide else min(max(6e-4 * effort, 1e-4), 1.0)
        if joint.mimic is not None:
            armature = min(armature, inertia)
        if kind is None and joint.mimic is None:
            # A passive joint has no motor.
            armature = 0.0
        velocity = joint.velocity or _DEFAULT_VELOCITY
        damping = joint.damping
        if not damping and (kind is not None or joint.mimic is not None):
            damping = 0.01 * effort / velocity
        resistance = damping + joint.friction
        total = inertia + armature
        if kind == "position":
            kp = min(effort / _ERROR["slide" if slide else "hinge"], total / (5.0 * _TIMESTEP) ** 2)
            kp = max(kp, 20.0 * resistance / _FRICTION_ERROR if joint.friction or joint.damping else 0.0)
            kv = max(2.0 * math.sqrt(kp * total) - damping, 0.0)
            return Drive(joint.name, kind, effort, armature, damping, kp, kv, self._compensates())
        if kind == "velocity":
            kv = max(effort / (_VELOCITY_ERROR * velocity), 20.0 * joint.damping)
            return Drive(joint.name, kind, effort, armature, damping, kv=kv)
        compensates = joint.name in self.control.controlled and kind == "motor" and self._compensates()
        return Drive(joint.name, kind, effort, armature, damping, gravcomp=compensates)

    def _compensates(self) -> bool:
        return not self.free if self.options.gravcomp == "auto" else self.options.gravcomp == "on"

    def _effort(self, joint: Joint, kind: ActuatorKind | None, inertia: float, gravity: float) -> float:
        if joint.effort is not None and joint.effort < _MAX_EFFORT:
            if kind == "position" and gravity > joint.effort:
                # Some robots carry their arms with springs, which a URDF does not contain.
                unit = "N" if joint.type == "prismatic" else "N m"
                self.report.add(
                    "warning",
                    "effort limit below what gravity needs in some poses, so the joint sags",
                    joint.name,
                    f"{joint.effort:.3g} of {gravity:.3g} {unit}",
                )
            return joint.effort
        effort = max(3.0 * gravity, 20.0 * inertia, 3.0 * joint.friction, _MIN_SPEED * joint.damping, 1e-3)
        if joint in self.wheels:
            # Twice the torque at which the wheels slip, so that skid steering turns.
            lever = max(_WHEEL_LEVER, 2.0 * self.wheel_radius)
            effort = max(effort, self.mass * GRAVITY * lever / len(self.wheels))
        if kind is not None:
            self.report.add(
                "guess", "effort limit", joint.name, f"{effort:.3g} {'N' if joint.type == 'prismatic' else 'N m'}"
            )
        return effort


def write_drives(mjcf: Mjcf, robot: Robot, drives: list[Drive], controlled: Collection[str], report: Report) -> None:
    """Adds the actuators, and the dynamics of the joints.

    Args:
        mjcf: The model.
        robot: The robot.
        drives: The drives.
        controlled: Joints with motors that PIDs control.
        report: The report.
    """
    section = mjcf.section("actuator")
    compensating = False
    for drive in drives:
        joint, element = robot.joints[drive.joint], mjcf.joints[drive.joint]
        if drive.armature:
            element.set("armature", exactly([drive.armature]))
        if drive.damping:
            element.set("damping", exactly([drive.damping]))
        if drive.kind is None:
            continue
        element.set("actuatorfrcrange", exactly([-drive.effort, drive.effort]))
        common = {"name": drive.joint, "joint": drive.joint}
        if drive.kind == "position":
            attributes = common | {"kp": exactly([drive.kp]), "kv": exactly([drive.kv])}
            if joint.range is not None:
                attributes["ctrlrange"] = exactly(joint.range)
            SubElement(section, "position", attributes)
            values = f"kp {drive.kp:.3g}, kv {drive.kv:.3g}"
        elif drive.kind == "velocity":
            attributes = common | {"kv": exactly([drive.kv])}
            if joint.velocity is not None:
                attributes["ctrlrange"] = exactly([-joint.velocity, joint.velocity])
            SubElement(section, "velocity", attributes)
            values = f"kv {drive.kv:.3g}"
        else:
            SubElement(section, "motor", common | {"ctrlrange": exactly([-drive.effort, drive.effort])})
            values = ""
        if drive.gravcomp:
            element.set("actuatorgravcomp", "true")
            compensating = True
        detail = ", ".join(filter(None, (values, f"armature {drive.armature:.3g}")))
        report.add("guess", f"{drive.kind} actuator", drive.joint, detail)
        if drive.kind == "motor" and drive.joint not in controlled:
            report.add(
                "warning",
                "motors as the URDF says, which do not hold a pose; --actuators position replaces them",
                drive.joint,
            )
    if compensating:
        # At a joint with a motor that nothing controls, the compensation would act without its actuator.
        motors = [robot.joints[drive.joint].child for drive in drives if drive.kind == "motor" and not drive.gravcomp]
        uncompensated = {robot.root, *motors, *(below.child for link in motors for below in robot.walk(link))}
        for name, body in mjcf.bodies.items():
            if body.tag == "body" and robot.group_root(name) not in uncompensated:
                body.set("gravcomp", "1")
        report.add("guess", "gravity compensation by the servos (--gravcomp)", "on")
