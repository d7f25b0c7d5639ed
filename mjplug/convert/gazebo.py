"""Reads the `<gazebo>` elements of a URDF: colours, friction, sensors and plugins."""

from dataclasses import dataclass, field
from xml.etree.ElementTree import Element

from mjplug.convert.materials import GAZEBO_COLOURS, Colour
from mjplug.convert.report import Report
from mjplug.convert.robot import Robot
from mjplug.errors import did_you_mean


@dataclass(slots=True)
class Gazebo:
    """What Gazebo's elements say.

    Attributes:
        colours: Colours by link.
        friction: Friction coefficients by link.
        sensors: Sensors with their links. A sensor at a joint is at its child.
        plugins: Names and elements of plugins of the whole robot.
    """

    colours: dict[str, Colour] = field(default_factory=dict)
    friction: dict[str, float] = field(default_factory=dict)
    sensors: list[tuple[str, Element]] = field(default_factory=list)
    plugins: list[tuple[str, Element]] = field(default_factory=list)


def read_gazebo(root: Element, robot: Robot, report: Report) -> Gazebo:
    """Reads all `<gazebo>` elements."""
    gazebo = Gazebo()
    for element in root.iterfind("gazebo"):
        for plugin in element.iterfind("plugin"):
            gazebo.plugins.append((plugin.get("filename") or plugin.get("name") or "", plugin))
        reference = element.get("reference", "")
        if not reference:
            continue
        if reference in robot.links:
            link = reference
        elif reference in robot.joints:
            link = robot.joints[reference].child
        else:
            near = did_you_mean(reference, [*robot.links, *robot.joints])
            report.add("warning", f"<gazebo> names a link or joint that does not exist{near}", reference)
            continue
        _read_reference(element, link, gazebo)
    for name, _ in gazebo.plugins:
        if "control" not in name:
            report.add("loss", "Gazebo plugin", name)
    return gazebo


def _read_reference(element: Element, link: str, gazebo: Gazebo) -> None:
    material = (element.findtext("material") or element.findtext("visual/material/script/name") or "").strip()
    colour = GAZEBO_COLOURS.get(material.removeprefix("Gazebo/"))
    if colour is not None:
        gazebo.colours[link] = colour
    for path in ("mu1", "mu", "collision/surface/friction/ode/mu", "surface/friction/ode/mu"):
        try:
            value = float(element.findtext(path) or "")
        except ValueError:
            continue
        # Gazebo's files use huge numbers for "does not slip".
        gazebo.friction[link] = min(max(value, 0.0), 5.0)
        break
    gazebo.sensors += [(link, sensor) for sensor in element.iterfind("sensor")]
