"""Reads the robot from a URDF: links, joints and materials."""

import math
from typing import cast, get_args
from xml.etree.ElementTree import Element

import numpy as np

from mjplug.convert.report import Report
from mjplug.convert.robot import Geometry, Inertial, Joint, JointType, Link, Material, Mimic, Robot
from mjplug.convert.rotations import IDENTITY, Array, pose
from mjplug.convert.tree import check_mimics, check_tree
from mjplug.errors import ModelError, did_you_mean

_TYPES: dict[str, JointType] = {name: name for name in get_args(JointType)} | {"spherical": "ball"}

_LARGEST = 1e30
"""Largest number, so that products of a few numbers do not overflow."""


def read_robot(root: Element, report: Report) -> Robot:
    """Reads a `<robot>`.

    Args:
        root: The element.
        report: Gets a note for each part that is left out.

    Raises:
        ModelError: The links and joints are not a tree, or a value is invalid.
    """
    materials = _materials(root)
    links: dict[str, Link] = {}
    for element in root.iterfind("link"):
        name = _name(element, "link")
        if name in links:
            raise ModelError(f"two links have the name {name!r}")
        links[name] = _link(element, name, materials, report)
    if not links:
        raise ModelError("the robot has no link")
    joints: dict[str, Joint] = {}
    for element in root.findall("joint"):
        joint = _joint(element, links, report)
        if joint.name in joints:
            raise ModelError(f"two joints have the name {joint.name!r}")
        joints[joint.name] = joint
    robot = Robot(root.get("name") or "robot", links, joints)
    check_tree(robot)
    check_mimics(robot, report)
    return robot


def floats(text: str, count: int, what: str) -> tuple[float, ...]:
    """Returns the finite numbers of an attribute.

    Raises:
        ModelError: It does not contain exactly `count` numbers that are finite and not too large to compute with.
    """
    try:
        values = tuple(float(part) for part in text.split())
    except ValueError:
        values = ()
    if len(values) != count or not all(abs(value) <= _LARGEST for value in values):
        wanted = "a number" if count == 1 else f"{count} numbers"
        limit = f" of at most {_LARGEST:g}" if len(values) == count and all(map(math.isfinite, values)) else ""
        raise ModelError(f"{what} is {text!r}; it must be {wanted}{limit}")
    return values


def origin_of(element: Element, what: str) -> Array:
    """Returns the pose of an element's `<origin>`; without one, the identity."""
    origin = element.find("origin")
    if origin is None:
        return IDENTITY
    xyz = floats(origin.get("xyz") or "0 0 0", 3, f"xyz of {what}")
    if origin.get("quat_xyzw"):
        raise ModelError(f"{what} has quat_xyzw, which is not supported; write rpy")
    return pose(xyz, floats(origin.get("rpy") or "0 0 0", 3, f"rpy of {what}"))


def _name(element: Element, kind: str) -> str:
    name = element.get("name", "")
    if not name:
        raise ModelError(f"a <{kind}> has no name")
    return name


def _materials(root: Element) -> dict[str, Material]:
    """Returns all defined materials; one that is defined inside a link can be used by others too."""
    found: dict[str, Material] = {}
    inside = root.iterfind("link/visual/material")
    for element in [*root.iterfind("material"), *inside]:
        name = element.get("name", "")
        material = _material(element)
        if name and name not in found and (material.rgba or material.texture):
            found[name] = material
    return found


def _material(element: Element) -> Material:
    name = element.get("name", "")
    color, texture = element.find("color"), element.find("texture")
    rgba = None
    if color is not None and color.get("rgba"):
        values = floats(color.get("rgba", ""), 4, f"rgba of material {name!r}")
        rgba = cast(tuple[float, float, float, float], tuple(min(max(value, 0.0), 1.0) for value in values))
    return Material(name, rgba, texture.get("filename", "") if texture is not None else "")


def _link(element: Element, name: str, materials: dict[str, Material], report: Report) -> Link:
    link = Link(name, _inertial(element, name))
    for visual in element.iterfind("visual"):
        material = visual.find("material")
        used = Material()
        if material is not None:
            used = _material(material)
            if used.rgba is None and not used.texture:
                used = materials.get(used.name, used)
        link.visuals += _geometry(visual, name, used, report)
    for collision in element.iterfind("collision"):
        link.collisions += _geometry(collision, name, Material(), report)
    return link


def _inertial(element: Element, link: str) -> Inertial | None:
    inertial = element.find("inertial")
    if inertial is None:
        return None
    mass_element, tensor = inertial.find("mass"), inertial.find("inertia")
    mass = 0.0 if mass_element is None else floats(mass_element.get("value", "0"), 1, f"the mass of link {link!r}")[0]
    if mass < 0.0:
        raise ModelError(f"the mass of link {link!r} is {mass:g} kg; it must not be negative")
    if mass == 0.0:
        return None
    values = {}
    for part in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"):
        text = "0" if tensor is None else tensor.get(part, "0")
        values[part] = floats(text, 1, f"{part} of link {link!r}")[0]
    matrix = np.array(
        [
            [values["ixx"], values["ixy"], values["ixz"]],
            [values["ixy"], values["iyy"], values["iyz"]],
            [values["ixz"], values["iyz"], values["izz"]],
        ]
    )
    return Inertial(mass, origin_of(inertial, f"the inertial of link {link!r}"), matrix)


def _geometry(element: Element, link: str, material: Material, report: Report) -> list[Geometry]:
    """Returns the shape of a `<visual>` or `<collision>`; nothing if it has none that can be used."""
    what = f"a {element.tag} of link {link!r}"
    geometry = element.find("geometry")
    shape = None if geometry is None else next(iter(geometry), None)
    if shape is None:
        report.add("loss", f"<{element.tag}> without a geometry", link)
        return []
    here = origin_of(element, what)
    if shape.tag == "mesh":
        scale = floats(shape.get("scale") or "1 1 1", 3, f"scale of {what}")
        if 0.0 in scale or not shape.get("filename"):
            report.add("loss", "mesh without a file name or with a scale of zero", link)
            return []
        triple = (scale[0], scale[1], scale[2])
        return [Geometry("mesh", (), here, shape.get("filename", ""), triple, material)]
    parts = {"box": ("size",), "cylinder": ("radius", "length"), "capsule": ("radius", "length"), "sphere": ("radius",)}
    if shape.tag not in parts:
        report.add("loss", f"unknown shape <{shape.tag}>", link)
        return []
    size: tuple[float, ...] = ()
    for part in parts[shape.tag]:
        size += floats(shape.get(part, ""), 3 if part == "size" else 1, f"{part} of {what}")
    if min(size) <= 0.0:
        report.add("loss", "shape with a size of zero or less", link, f"{shape.tag} {size}")
        return []
    return [Geometry(shape.tag, size, here, material=material)]


def _joint(element: Element, links: dict[str, Link], report: Report) -> Joint:
    name = _name(element, "joint")
    kind = _TYPES.get(element.get("type", ""))
    if kind is None:
        raise ModelError(f"joint {name!r} has the type {element.get('type', '')!r}; known: {', '.join(_TYPES)}")
    ends = []
    for end in ("parent", "child"):
        found = element.find(end)
        link = "" if found is None else found.get("link", "")
        if link not in links:
            raise ModelError(
                f"the {end} of joint {name!r} is {link!r}, but there is no such link{did_you_mean(link, links)}"
            )
        ends.append(link)
    joint = Joint(name, kind, ends[0], ends[1], origin_of(element, f"joint {name!r}"), _axis(element, name, kind))
    limit, dynamics, mimic = element.find("limit"), element.find("dynamics"), element.find("mimic")
    if limit is not None:
        _read_limit(limit, joint, report)
    if dynamics is not None:
        joint.damping, joint.friction = (
            max(0.0, floats(dynamics.get(part) or "0", 1, f"{part} of joint {name!r}")[0])
            for part in ("damping", "friction")
        )
    if mimic is not None:
        factors = [
            floats(mimic.get(part) or default, 1, f"{part} of the mimic of joint {name!r}")[0]
            for part, default in (("multiplier", "1"), ("offset", "0"))
        ]
        joint.mimic = Mimic(mimic.get("joint", ""), factors[0], factors[1])
    return joint


def _axis(element: Element, name: str, kind: JointType) -> Array:
    axis = element.find("axis")
    values = np.array(
        floats((axis.get("xyz") if axis is not None else None) or "1 0 0", 3, f"the axis of joint {name!r}")
    )
    length = float(np.linalg.norm(values))
    if length < 1e-9:
        if kind in ("fixed", "floating", "ball"):
            return np.array([1.0, 0.0, 0.0])
        raise ModelError(f"the axis of joint {name!r} is zero")
    return values / length


def _read_limit(limit: Element, joint: Joint, report: Report) -> None:
    def value(part: str) -> float | None:
        return floats(limit.get(part, ""), 1, f"{part} of joint {joint.name!r}")[0] if limit.get(part) else None

    lower, upper = value("lower") or 0.0, value("upper") or 0.0
    if joint.type in ("revolute", "prismatic"):
        if lower > upper:
            raise ModelError(
                f"joint {joint.name!r} has the limits {lower:g} to {upper:g}; the lower one must come first"
            )
        if lower < upper:
            joint.range = (lower, upper)
        else:
            report.add("guess", "equal limits mean no limits", joint.name)
    joint.effort, joint.velocity = (abs(found) if (found := value(part)) else None for part in ("effort", "velocity"))
