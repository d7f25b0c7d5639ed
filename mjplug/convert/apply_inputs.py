"""Applies `<mujoco_inputs>` to a model: cameras, lidars, changed attributes, and copied sections."""

import re
from copy import deepcopy
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from mjplug.convert.inputs import Lidar, MujocoInputs
from mjplug.convert.mjcf import Mjcf
from mjplug.convert.rotations import numbers, quaternion
from mjplug.errors import ModelError, did_you_mean

_SINGLE = ("compiler", "option", "size", "visual", "statistic")
"""Sections whose attributes and elements are merged with the existing ones."""

_OPTICAL = "0 1 0 0"
"""Rotation of a MuJoCo camera in an optical frame: half a turn about x."""

_LIDAR = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Rotation of the first rangefinder in a lidar frame: its z axis is the x axis of the frame, its y axis is z."""


def add_sites(mjcf: Mjcf) -> None:
    """Adds a site with the name of its link to each body, unless there is one."""
    for link, body in mjcf.bodies.items():
        if body.find(f"site[@name='{link}']") is None:
            body.append(Element("site", name=link, group="4"))


def apply_inputs(mjcf: Mjcf, inputs: MujocoInputs) -> None:
    """Applies the inputs; copied sections come last, so that they replace generated elements.

    Raises:
        ModelError: An element names something that the model does not contain.
    """
    for link, camera in inputs.cameras:
        camera.set("quat", _OPTICAL)
        _body(mjcf, link, f"camera {camera.get('name')!r}").append(camera)
    for lidar in inputs.lidars:
        _add_lidar(mjcf, lidar)
    _merge(mjcf, inputs.raw)
    for change in inputs.changes:
        _modify(mjcf, change)


def _body(mjcf: Mjcf, link: str, what: str) -> Element:
    if link not in mjcf.bodies:
        raise ModelError(f"{what} is at site {link!r}, but the robot has no such link{did_you_mean(link, mjcf.bodies)}")
    return mjcf.bodies[link]


def _add_lidar(mjcf: Mjcf, lidar: Lidar) -> None:
    """Adds the sites of the rangefinders in a `<replicate>`, which MuJoCo also applies to a sensor at the site."""
    above = _body(mjcf, lidar.link, f"lidar {lidar.sensor!r}")
    turn = np.array(
        [
            [np.cos(lidar.min_angle), 0, np.sin(lidar.min_angle)],
            [0, 1, 0],
            [-np.sin(lidar.min_angle), 0, np.cos(lidar.min_angle)],
        ]
    )
    body = SubElement(
        above, "body", name=f"{lidar.link}_lidar_body_{lidar.sensor}", quat=numbers(quaternion(_LIDAR @ turn), 15)
    )
    copies = SubElement(
        body, "replicate", count=str(lidar.count), sep="-", offset="0 0 0", euler=f"0 {lidar.increment!r} 0"
    )
    SubElement(copies, "site", name=lidar.sensor, group="4")


def _modify(mjcf: Mjcf, change: Element) -> None:
    attributes = dict(change.attrib)
    kind = attributes.pop("type")
    if kind == "geom" and "name" not in attributes:
        mesh, geom_class = attributes.pop("mesh", None), attributes.pop("class", None)
        if mesh is None or geom_class is None:
            raise ModelError("a <modify_element> of type 'geom' needs 'name', or 'mesh' and 'class'")
        geoms = [geom for geom in mjcf.root.iter("geom") if geom.get("mesh") and geom.get("class") == geom_class]
        names = {_stem(geom.get("mesh", "")) for geom in geoms}
        found = [geom for geom in geoms if mesh in (_stem(geom.get("mesh", "")), geom.get("mesh"))]
        wanted = f"mesh {mesh!r} and class {geom_class!r}{did_you_mean(mesh, names)}"
    else:
        name = attributes.pop("name", None)
        if name is None:
            raise ModelError(f"a <modify_element> of type {kind!r} has no name")
        found = [element for element in mjcf.root.iter(kind) if element.get("name") == name]
        names = {element.get("name", "") for element in mjcf.root.iter(kind)} - {""}
        wanted = f"name {name!r}{did_you_mean(name, names)}"
    if not found:
        raise ModelError(f"<modify_element>: the model has no {kind} with the {wanted}")
    for element in found:
        element.attrib.update(attributes)


def _stem(mesh: str) -> str:
    """Returns the name of a mesh's file, without the endings of its parts."""
    return re.sub(r"(_collision)?(_\d+)?$", "", mesh)


def _merge(mjcf: Mjcf, sections: list[Element]) -> None:
    for section in sections:
        copy = deepcopy(section)
        if copy.tag == "default":
            _merge_defaults(mjcf.section("default"), copy)
        elif copy.tag in _SINGLE:
            _merge_into(mjcf.section(copy.tag), copy)
        else:
            if copy.tag == "actuator":
                _replace_actuators(mjcf, copy)
            elif copy.tag == "equality":
                _replace_equalities(mjcf, copy)
            existing = mjcf.section(copy.tag)
            existing.attrib.update(copy.attrib)
            existing.extend(copy)


def _merge_into(existing: Element, new: Element) -> None:
    existing.attrib.update(new.attrib)
    for child in new:
        same = existing.find(child.tag)
        if same is None:
            existing.append(child)
        else:
            _merge_into(same, child)


def _merge_defaults(existing: Element, new: Element) -> None:
    existing.attrib.update(new.attrib)
    for child in new:
        if child.tag == "default":
            name = child.get("class")
            same = next((other for other in existing.findall("default") if other.get("class") == name), None)
        else:
            same = existing.find(child.tag)
        if same is None:
            existing.append(child)
        elif child.tag == "default":
            _merge_defaults(same, child)
        else:
            same.attrib.update(child.attrib)


def _replace_actuators(mjcf: Mjcf, new: Element) -> None:
    """Removes the generated actuators that have the name or the joint of a new one, also through a tendon."""
    generated = mjcf.section("actuator")
    names = {element.get("name") for element in new} - {None}
    joints = {element.get("joint") for element in new} - {None}
    for element in list(generated):
        if element.get("name") in names or element.get("joint") in joints:
            generated.remove(element)
            joint = mjcf.joints.get(element.get("joint", ""))
            if joint is not None:
                # The force limit was that of the generated actuator.
                joint.attrib.pop("actuatorfrcrange", None)


def _replace_equalities(mjcf: Mjcf, new: Element) -> None:
    generated = mjcf.section("equality")
    pairs = {frozenset((element.get("joint1"), element.get("joint2"))) for element in new.findall("joint")}
    for element in generated.findall("joint"):
        if frozenset((element.get("joint1"), element.get("joint2"))) in pairs:
            generated.remove(element)
