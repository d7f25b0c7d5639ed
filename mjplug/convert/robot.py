"""A robot as its URDF describes it: links, joints, materials. SI units, poses as homogeneous matrices (4, 4)."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

from mjplug.convert.rotations import Array

JointType = Literal["revolute", "continuous", "prismatic", "fixed", "floating", "planar", "ball"]

MOVING_HINGES = ("revolute", "continuous")
SCALAR = ("revolute", "continuous", "prismatic")
"""Joints with one coordinate."""

MAX_POSITION = 1e10
"""MuJoCo treats positions from this on as a divergence [rad, m]."""


@dataclass(frozen=True, slots=True)
class Material:
    """A material: colour as red, green, blue, alpha from 0 to 1, and the URI of a texture."""

    name: str = ""
    rgba: tuple[float, float, float, float] | None = None
    texture: str = ""


@dataclass(frozen=True, slots=True)
class Geometry:
    """A shape of a link.

    Attributes:
        shape: `box`, `cylinder`, `sphere`, `capsule` or `mesh`.
        size: Edge lengths of a box; radius and length of a cylinder or capsule; radius of a sphere [m].
        mesh: URI of a mesh.
        scale: Scale of a mesh along its axes.
        pose: Pose in the link.
        material: Material of a visual.
    """

    shape: str
    size: tuple[float, ...]
    pose: Array
    mesh: str = ""
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    material: Material = Material()


@dataclass(frozen=True, slots=True)
class Inertial:
    """Mass [kg], pose of the inertial frame in the link, and inertia tensor (3, 3) in its axes [kg m²]."""

    mass: float
    pose: Array
    tensor: Array


@dataclass(slots=True)
class Link:
    """A link; `inertial` is None if the URDF has none or its mass is zero."""

    name: str
    inertial: Inertial | None = None
    visuals: list[Geometry] = field(default_factory=list)
    collisions: list[Geometry] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Mimic:
    """The joint follows `multiplier` · position of `joint` + `offset`."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(slots=True)
class Joint:
    """A joint.

    Attributes:
        name: The name.
        type: The type.
        parent: The parent link.
        child: The child link.
        pose: Pose of the child in the parent at position zero.
        axis: Unit axis in the child's axes.
        range: Lower and upper limit [rad, m]; None if it is unlimited.
        effort: Largest force or torque [N, N m]; None if the URDF does not limit it.
        velocity: Largest velocity [rad/s, m/s]; None if the URDF does not limit it.
        damping: Damping [N m s/rad, N s/m].
        friction: Static friction [N m, N].
        mimic: The joint that it follows.
    """

    name: str
    type: JointType
    parent: str
    child: str
    pose: Array
    axis: Array
    range: tuple[float, float] | None = None
    effort: float | None = None
    velocity: float | None = None
    damping: float = 0.0
    friction: float = 0.0
    mimic: Mimic | None = None


@dataclass(frozen=True)
class Robot:
    """The tree of a robot.

    Attributes:
        name: The name of the robot.
        links: Links by name, in the order of the file.
        joints: Joints by name, in the order of the file.
    """

    name: str
    links: dict[str, Link]
    joints: dict[str, Joint]

    @cached_property
    def parent_joint(self) -> dict[str, Joint]:
        """The joint above each link; the root has none."""
        return {joint.child: joint for joint in self.joints.values()}

    @cached_property
    def child_joints(self) -> dict[str, list[Joint]]:
        """The joints below each link."""
        below: dict[str, list[Joint]] = {name: [] for name in self.links}
        for joint in self.joints.values():
            below[joint.parent].append(joint)
        return below

    @cached_property
    def root(self) -> str:
        """The root link."""
        return next(name for name in self.links if name not in self.parent_joint)

    @cached_property
    def scalar_joints(self) -> list[Joint]:
        """Joints with one coordinate, in the order of the tree, which is that of the MJCF."""
        return [joint for joint in self.walk() if joint.type in SCALAR]

    def walk(self, link: str | None = None) -> Iterator[Joint]:
        """Yields the joints below a link (default: the root), parents before children."""
        stack = list(reversed(self.child_joints[link or self.root]))
        while stack:
            joint = stack.pop()
            yield joint
            stack.extend(reversed(self.child_joints[joint.child]))

    def rigid_group(self, link: str) -> list[str]:
        """Returns the links that do not move relative to a link and hang on it, beginning with the link."""
        group, stack = [], [link]
        while stack:
            name = stack.pop()
            group.append(name)
            stack.extend(joint.child for joint in reversed(self.child_joints[name]) if joint.type == "fixed")
        return group

    def group_root(self, link: str) -> str:
        """Returns the topmost link that does not move relative to a link."""
        while link in self.parent_joint and self.parent_joint[link].type == "fixed":
            link = self.parent_joint[link].parent
        return link

    def has_moving_descendants(self, joint: Joint) -> bool:
        """Returns whether another joint below this one moves."""
        return any(other.type != "fixed" for other in self.walk(joint.child))
