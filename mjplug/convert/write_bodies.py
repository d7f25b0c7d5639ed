"""Writes the bodies, joints and geoms of a robot as MJCF."""

from collections.abc import Collection
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from mjplug.convert.gazebo import Gazebo
from mjplug.convert.inertia import inertial_attributes
from mjplug.convert.materials import PLAIN, Materials
from mjplug.convert.mesh_assets import Asset, Kind, MeshAssets
from mjplug.convert.mjcf import Mjcf, empty_mjcf
from mjplug.convert.options import ConversionOptions
from mjplug.convert.report import Report
from mjplug.convert.robot import MOVING_HINGES, SCALAR, Geometry, Joint, Link, Robot
from mjplug.convert.rotations import Array, exactly, numbers, pose_attributes
from mjplug.errors import ModelError

WORLD = "world"

_DENSITY = "1000"
"""Density for links whose mass must be guessed [kg/m³]."""

_SMALL = {"mass": "0.001", "pos": "0 0 0", "diaginertia": "1e-06 1e-06 1e-06"}
"""Inertia of a moving link without mass and without geometry."""


@dataclass(frozen=True, slots=True)
class BodyWriter:
    """Writes the bodies of a robot.

    Attributes:
        robot: The robot.
        options: The options.
        gazebo: Colours and friction.
        meshes: The meshes.
        materials: The materials.
        report: The report.
    """

    robot: Robot
    options: ConversionOptions
    gazebo: Gazebo
    meshes: MeshAssets
    materials: Materials
    report: Report

    def write(self) -> Mjcf:
        """Returns the model with a fixed base and without actuators.

        Raises:
            ModelError: The robot has a part that MuJoCo cannot represent.
        """
        mjcf = empty_mjcf(self.robot.name)
        compiler = mjcf.section("compiler")
        compiler.attrib.update({"angle": "radian", "meshdir": "assets", "texturedir": "assets", "autolimits": "true"})
        if self.options.fuse:
            compiler.set("fusestatic", "true")
        mjcf.section("option").attrib.update({"timestep": "0.002", "integrator": "implicitfast"})
        self._write_defaults(mjcf)
        self._write_link(mjcf, mjcf.section("worldbody"), self.robot.root)
        self._write_masses(mjcf)
        self._write_mimics(mjcf)
        asset = mjcf.section("asset")
        self.materials.write(asset)
        self.meshes.write(asset)
        return mjcf

    def _write_defaults(self, mjcf: Mjcf) -> None:
        links = self.robot.links.values()
        shown = any(link.visuals for link in links)
        if self.options.collision == "urdf" and not any(link.collisions for link in links):
            self.report.add(
                "warning",
                "the robot has no collision geometry, so it passes through everything; try --collision visual",
            )
        defaults = mjcf.section("default")
        visual = SubElement(defaults, "default", {"class": "visual"})
        SubElement(visual, "geom", group="2", contype="0", conaffinity="0", density="0")
        collision = SubElement(defaults, "default", {"class": "collision"})
        # If there is nothing else to show, the collision geometry is shown.
        SubElement(collision, "geom", group="3" if shown else "2", density="0")

    def _write_link(self, mjcf: Mjcf, parent: Element, name: str) -> None:
        stack: list[tuple[Element, str, Joint | None]] = [(parent, name, None)]
        while stack:
            above, link_name, via = stack.pop()
            link = self.robot.links[link_name]
            if via is None and link_name == WORLD:
                body = above
            elif link_name == WORLD:
                raise ModelError(f"link {WORLD!r} must be the root; joint {via and via.name!r} is above it")
            else:
                body = SubElement(above, "body", {"name": link_name, **(pose_attributes(via.pose) if via else {})})
            mjcf.bodies[link_name] = body
            if link.inertial is not None and body.tag == "body":
                SubElement(body, "inertial", inertial_attributes(link.inertial, link_name, self.report))
            if via is not None:
                self._write_joint(mjcf, body, via)
            self._write_geoms(mjcf, body, link)
            for below in reversed(self.robot.child_joints[link_name]):
                stack.append((self._place_of(mjcf, body, below), below.child, below))

    def _place_of(self, mjcf: Mjcf, body: Element, joint: Joint) -> Element:
        """Returns the parent body for the child of a joint; a floating body must be a child of the world."""
        if joint.type != "floating":
            return body
        if joint.parent != self.robot.root:
            raise ModelError(
                f"joint {joint.name!r} is floating below link {joint.parent!r}; MuJoCo supports floating joints only "
                "at the root link"
            )
        return mjcf.section("worldbody")

    def _write_joint(self, mjcf: Mjcf, body: Element, joint: Joint) -> None:
        if joint.type == "floating":
            SubElement(body, "freejoint", name=joint.name)
        elif joint.type == "ball":
            SubElement(body, "joint", {"name": joint.name, "type": "ball", **_dynamics(joint)})
        elif joint.type == "planar":
            self.report.add("guess", "planar joint became two slides and a hinge", joint.name)
            x, y = _plane(joint.axis)
            for suffix, kind, axis in (("x", "slide", x), ("y", "slide", y), ("yaw", "hinge", joint.axis)):
                name = f"{joint.name}_{suffix}"
                attributes = {"name": name, "type": kind, "axis": numbers(axis, 15), **_dynamics(joint)}
                SubElement(body, "joint", attributes)
        elif joint.type in SCALAR:
            kind = "hinge" if joint.type in MOVING_HINGES else "slide"
            element = SubElement(body, "joint", name=joint.name, type=kind, axis=numbers(joint.axis, 15))
            if joint.range is not None:
                element.set("range", exactly(joint.range))
            element.attrib.update(_dynamics(joint))
            mjcf.joints[joint.name] = element

    def _write_geoms(self, mjcf: Mjcf, body: Element, link: Link) -> None:
        for geometry in link.visuals:
            for asset in self._assets(geometry, "visual", link.name):
                geom = SubElement(body, "geom", {"class": "visual", **self._shape(geometry, asset)})
                geom.set("material", self._material(geometry, asset, link.name))
        geoms: list[Element] = []
        mjcf.collisions[link.name] = geoms
        sources = link.visuals if self._pictures_collide(link.name) else link.collisions
        for geometry in sources:
            for asset in self._assets(geometry, "collision", link.name):
                name = f"{link.name}_collision" + (f"_{len(geoms)}" if geoms else "")
                geoms.append(
                    SubElement(body, "geom", {"class": "collision", "name": name, **self._shape(geometry, asset)})
                )
        friction = self.gazebo.friction.get(link.name)
        if friction is not None:
            for geom in geoms:
                geom.set("friction", numbers((friction, 0.005, 0.0001)))

    def _pictures_collide(self, link: str) -> bool:
        kind, _, links = self.options.collision.partition(":")
        if kind != "visual":
            return False
        named = [name for name in links.split(",") if name]
        unknown = [name for name in named if name not in self.robot.links]
        if unknown:
            raise ModelError(f"--collision names links that the robot does not have: {', '.join(unknown)}")
        return not named or link in named

    def _assets(self, geometry: Geometry, kind: Kind, link: str) -> list[Asset]:
        if geometry.shape != "mesh":
            return [Asset("")]
        return self.meshes.use(geometry, kind, link)

    def _shape(self, geometry: Geometry, asset: Asset) -> dict[str, str]:
        if asset.box is not None:
            center, axes, half = asset.box
            inside = np.eye(4)
            inside[:3, :3], inside[:3, 3] = axes, center
            return {"type": "box", "size": numbers(half), **pose_attributes(geometry.pose @ inside)}
        place = pose_attributes(geometry.pose)
        if geometry.shape == "mesh":
            return {"type": "mesh", "mesh": asset.name, **place}
        size = geometry.size
        if geometry.shape == "box":
            size = tuple(edge / 2.0 for edge in size)
        elif geometry.shape in ("cylinder", "capsule"):
            size = (size[0], size[1] / 2.0)
        return {"type": geometry.shape, "size": numbers(size), **place}

    def _material(self, geometry: Geometry, asset: Asset, link: str) -> str:
        if asset.material is not None:
            return asset.material
        given = geometry.material
        if given.texture:
            self.report.add("loss", "texture that a URDF material names; its colour is used", link, given.texture)
        if given.rgba is not None:
            return self.materials.colour(given.rgba, given.name)
        return self.materials.colour(self.gazebo.colours.get(link, PLAIN))

    def _write_masses(self, mjcf: Mjcf) -> None:
        """Gives a mass to each moving group of links that has none."""
        for joint in self.robot.walk():
            if joint.type == "fixed":
                continue
            group = self.robot.rigid_group(joint.child)
            if not any(self.robot.links[name].inertial for name in group):
                _guess_mass(mjcf, joint.child, group, self.report)

    def give_mass_to_root(self, mjcf: Mjcf) -> None:
        """Gives a mass to a root that has none but is free to move."""
        group = self.robot.rigid_group(self.robot.root)
        if not any(self.robot.links[name].inertial for name in group):
            _guess_mass(mjcf, self.robot.root, group, self.report)

    def _write_mimics(self, mjcf: Mjcf) -> None:
        equality = mjcf.section("equality")
        for joint in self.robot.scalar_joints:
            if joint.mimic is not None:
                coefficients = numbers((joint.mimic.offset, joint.mimic.multiplier, 0, 0, 0), 15)
                SubElement(
                    equality, "joint", name=f"{joint.name}_mimic", joint1=joint.name, joint2=joint.mimic.joint,
                    polycoef=coefficients, solref="0.005 1",
                )  # fmt: skip


def _guess_mass(mjcf: Mjcf, root: str, group: Collection[str], report: Report) -> None:
    geoms = [geom for name in group for geom in mjcf.collisions[name]]
    if not geoms:
        # The mesh of a picture has no volume, so only its simple shapes count.
        pictures = [geom for name in group for geom in mjcf.bodies[name].findall("geom")]
        geoms = [geom for geom in pictures if geom.get("type") != "mesh"]
    for geom in geoms:
        geom.set("density", _DENSITY)
    if geoms:
        report.add("guess", "mass from the geometry at 1000 kg/m³", root)
    else:
        mjcf.bodies[root].insert(0, Element("inertial", _SMALL))
        report.add("guess", "mass of 1 g for a moving link without mass", root)


def _dynamics(joint: Joint) -> dict[str, str]:
    result = {}
    if joint.damping:
        result["damping"] = exactly([joint.damping])
    if joint.friction:
        result["frictionloss"] = exactly([joint.friction])
    return result


def _plane(normal: Array) -> tuple[Array, Array]:
    """Returns two unit vectors that are perpendicular to a normal and to each other."""
    start = np.eye(3)[int(np.argmin(np.abs(normal)))]
    if abs(normal[2]) > 0.9:
        start = np.array([1.0, 0.0, 0.0])
    x = start - normal * (start @ normal)
    x /= np.linalg.norm(x)
    return x, np.cross(normal, x)
