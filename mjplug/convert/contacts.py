"""Contacts of the robot with itself, and casters that slide."""

from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from mjplug.convert.mjcf import Mjcf
from mjplug.convert.options import ConversionOptions
from mjplug.convert.report import Report
from mjplug.convert.robot import MAX_POSITION, Joint, Robot
from mjplug.errors import ModelError

_CASTER_HEIGHT = 0.005
"""Parts of the base that are at most this far above the lowest point of the wheels slide on the floor [m]."""


def read_srdf(path: Path, robot: Robot) -> tuple[list[tuple[str, str]], dict[str, float]]:
    """Returns the disabled pairs of links, and the positions of the group states called `home`.

    Raises:
        ModelError: The file cannot be read, or names links or joints that the robot does not have.
    """
    try:
        root = ElementTree.parse(path).getroot()
    except OSError as error:
        raise ModelError(f"{path} cannot be read: {error.strerror}") from error
    except ElementTree.ParseError as error:
        raise ModelError(f"{path} is not valid XML: {error}") from error
    pairs = []
    for element in root.iterfind("disable_collisions"):
        first, second = element.get("link1", ""), element.get("link2", "")
        for link in (first, second):
            if link not in robot.links:
                raise ModelError(f"{path} names link {link!r}, which the robot does not have")
        pairs.append((first, second) if first < second else (second, first))
    home = {}
    for joint in root.iterfind("group_state[@name='home']/joint"):
        name, values = joint.get("name", ""), (joint.get("value") or "").split()
        if name not in robot.joints:
            raise ModelError(f"{path} names joint {name!r}, which the robot does not have")
        try:
            home[name] = float(values[0])
        except (ValueError, IndexError):
            raise ModelError(f"{path}: the position of joint {name!r} is not a number") from None
        if not abs(home[name]) < MAX_POSITION:
            raise ModelError(
                f"{path}: the position of joint {name!r} is {home[name]:g}; its magnitude must be below "
                f"{MAX_POSITION:g}"
            )
    return sorted(set(pairs)), home


def write_excludes(
    mjcf: Mjcf, robot: Robot, options: ConversionOptions, touching: Mapping[tuple[str, str], float],
    disabled: list[tuple[str, str]], report: Report,
) -> None:  # fmt: skip
    """Excludes contacts between pairs of links."""
    if options.self_collision == "none":
        colliding = [name for name, geoms in mjcf.collisions.items() if geoms]
        pairs = {tuple(sorted((a, b))) for i, a in enumerate(colliding) for b in colliding[i + 1 :]}
    else:
        pairs = set(disabled)
        if options.self_collision == "auto":
            for pair, part in touching.items():
                if pair not in pairs:
                    report.add(
                        "guess", "no collisions of links that touch at home or always", " - ".join(pair), f"{part:.0%}"
                    )
                pairs.add(pair)
    contact = mjcf.section("contact")
    for first, second in sorted(pairs):
        # Contacts of links that cannot move relative to each other do not exist anyway.
        if robot.group_root(first) != robot.group_root(second):
            SubElement(contact, "exclude", body1=first, body2=second)


def write_casters(mjcf: Mjcf, robot: Robot, wheels: list[Joint], lowest: Mapping[str, float], report: Report) -> None:
    """Lets the parts of the base that touch the floor slide: casters that the URDF has no joints for.

    Args:
        mjcf: The model.
        robot: The robot.
        wheels: The wheels.
        lowest: Lowest point of each collision geom by name, in the home pose [m].
        report: The report.
    """
    floor = min(
        (lowest[geom.get("name", "")] for wheel in wheels for geom in _geoms(mjcf, robot, wheel.child)), default=None
    )
    if floor is None:
        return
    for geom in _geoms(mjcf, robot, robot.root):
        name = geom.get("name", "")
        if lowest[name] < floor + _CASTER_HEIGHT:
            geom.set("friction", "0.02 0.005 0.0001")
            geom.set("priority", "1")
            report.add("guess", "part of the base that touches the floor slides like a caster", name)


def _geoms(mjcf: Mjcf, robot: Robot, link: str) -> list[Element]:
    return [geom for name in robot.rigid_group(link) for geom in mjcf.collisions[name]]
