"""Finds out whether a robot stands freely, which of its joints are wheels, and its home pose."""

import re
from collections.abc import Mapping

from mjplug.convert.control import Control
from mjplug.convert.kinematics import link_poses
from mjplug.convert.options import ConversionOptions
from mjplug.convert.report import Report
from mjplug.convert.robot import Joint, Robot
from mjplug.convert.write_bodies import WORLD

_HORIZONTAL = 0.5
"""A wheel's axis has at most this vertical part."""

_CLEAR = 0.02
"""If a base is higher than this above the lowest point of the robot, the robot stands on legs [m]."""


def wheels_of(robot: Robot) -> list[Joint]:
    """Returns the wheels: continuous joints with a horizontal axis, and with no moving joint below them."""
    poses = link_poses(robot, {})
    found = []
    for joint in robot.scalar_joints:
        axis = poses[joint.child][:3, :3] @ joint.axis
        if (
            joint.type == "continuous"
            and joint.mimic is None
            and abs(axis[2]) <= _HORIZONTAL
            and not robot.has_moving_descendants(joint)
        ):
            found.append(joint)
    return found


def is_caster(robot: Robot, wheel: Joint) -> bool:
    """Returns whether a wheel belongs to a caster, by its name or that of a joint or link above it."""
    names = [wheel.name, wheel.child, wheel.parent]
    return any(re.search("caster|castor", name, re.IGNORECASE) for name in names)


def home_positions(robot: Robot, control: Control, srdf_home: Mapping[str, float], report: Report) -> dict[str, float]:
    """Returns the home position of each joint with one coordinate [rad, m], without those of mimic joints.

    It is the initial value of ros2_control, else the group state `home` of the SRDF, else zero; where zero is outside
    of the limits, the middle.
    """
    home = {}
    for joint in robot.scalar_joints:
        if joint.mimic is not None:
            continue
        position = control.initial.get(joint.name, srdf_home.get(joint.name, 0.0))
        if joint.range is not None and not joint.range[0] <= position <= joint.range[1]:
            middle = (joint.range[0] + joint.range[1]) / 2.0
            report.add(
                "guess", "home position is outside of the limits; the middle is used", joint.name, f"{middle:.3g}"
            )
            position = middle
        home[joint.name] = position
    return home


def floating_joint(robot: Robot) -> Joint | None:
    """Returns the floating joint below the root, if there is one."""
    return next((joint for joint in robot.child_joints[robot.root] if joint.type == "floating"), None)


def stands_freely(
    robot: Robot, options: ConversionOptions, wheels: list[Joint], lowest: Mapping[str, float], report: Report
) -> bool:
    """Returns whether the root link needs a free joint.

    Args:
        robot: The robot.
        options: The options.
        wheels: The wheels.
        lowest: The lowest point of each link with geometry, in the home pose [m].
        report: The report.
    """
    if robot.root == WORLD or floating_joint(robot) is not None:
        if options.base == "free" and robot.root == WORLD:
            report.add("warning", f"the base is fixed, because the root link is {WORLD!r}")
        return False
    if options.base != "auto":
        return options.base == "free"
    if robot.root.startswith("base_footprint"):
        free, reason = True, f"the root link is {robot.root!r}"
    elif len(wheels) >= 2:
        free, reason = True, f"it has {len(wheels)} wheels"
    elif not robot.scalar_joints:
        free = any(link.inertial for link in robot.links.values())
        reason = "it has no moving joint, but a mass" if free else "it has neither moving joints nor a mass"
    elif not _has_limbs(robot):
        free, reason = False, "it is one chain of links"
    else:
        group = {name for name in robot.rigid_group(robot.root) if name in lowest}
        base = min((lowest[name] for name in group), default=None)
        rest = min((value for name, value in lowest.items() if name not in group), default=None)
        free = base is not None and rest is not None and base > min(base, rest) + _CLEAR
        reason = "its base is above its other links" if free else "its base is at the bottom"
    report.add("guess", "base (--base)", "free" if free else "fixed", reason)
    return free


def _has_limbs(robot: Robot) -> bool:
    """Returns whether at least two chains of links hang on the base, or most of the mass is in the base.

    An arm is one chain on a light base, and some arms hang below their base in the home pose.
    """
    base = robot.rigid_group(robot.root)
    limbs = sum(joint.type != "fixed" for name in base for joint in robot.child_joints[name])
    masses = {name: link.inertial.mass for name, link in robot.links.items() if link.inertial is not None}
    return limbs >= 2 or sum(masses.get(name, 0.0) for name in base) > sum(masses.values()) / 2.0
