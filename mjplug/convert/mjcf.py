"""The MJCF of a robot while it is written."""

from copy import deepcopy
from dataclasses import dataclass, field
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

SECTIONS = (
    "compiler", "option", "size", "visual", "statistic", "default", "asset", "worldbody", "contact", "equality",
    "tendon", "actuator", "sensor", "keyframe",
)  # fmt: skip
"""Sections of an MJCF in the order in which they are written."""


@dataclass(slots=True)
class Mjcf:
    """The elements of a model.

    Attributes:
        root: The `<mujoco>` element.
        bodies: The body of each link; of a root called `world` the `<worldbody>`.
        joints: The elements of joints with one coordinate, by name.
        collisions: The collision geoms of each link.
    """

    root: Element
    bodies: dict[str, Element] = field(default_factory=dict)
    joints: dict[str, Element] = field(default_factory=dict)
    collisions: dict[str, list[Element]] = field(default_factory=dict)

    def section(self, name: str) -> Element:
        """Returns a section, which is created if it does not exist."""
        found = self.root.find(name)
        return SubElement(self.root, name) if found is None else found

    def text(self) -> str:
        """Returns the XML, without empty sections."""
        return xml_text(self.root)

    def text_without_pictures(self) -> str:
        """Returns the XML without visual geoms, textures and unused meshes, which compiles much faster.

        If no geom collides, the visual geoms are kept, because the size of the robot is measured with them.
        """
        copy = deepcopy(self.root)
        if any(self.collisions.values()):
            for body in [*copy.findall("worldbody"), *copy.iter("body")]:
                for geom in body.findall("geom[@class='visual']"):
                    body.remove(geom)
        used = {geom.get("mesh") for geom in copy.iter("geom")}
        for geom in copy.iter("geom"):
            geom.attrib.pop("material", None)
        for asset in copy.findall("asset"):
            for element in list(asset):
                if element.tag != "mesh" or element.get("name") not in used:
                    asset.remove(element)
        return xml_text(copy)


def empty_mjcf(name: str) -> Mjcf:
    """Returns a model with the sections that each robot has."""
    return Mjcf(Element("mujoco", model=name))


def xml_text(root: Element) -> str:
    """Returns an element as indented XML: sections in their usual order, without the empty ones."""
    copy = Element(root.tag, root.attrib)
    order = {name: i for i, name in enumerate(SECTIONS)}
    children = [child for child in root if len(child) or child.attrib]
    copy.extend(sorted(children, key=lambda child: order.get(child.tag, -1 if child.tag == "include" else len(order))))
    ElementTree.indent(copy)
    return ElementTree.tostring(copy, encoding="unicode") + "\n"
