"""Transmissions of ros2_control: the relation between the coordinates of joints and those of actuators.

Every type is linear: with the reductions in a matrix M, the actuators are at M · (joints - offsets), their velocities
are M · velocities, and their efforts are the inverse transpose of M · efforts. The elements of M are those of
ros2_control's package transmission_interface (`simple_transmission.hpp`, `differential_transmission.hpp` and
`four_bar_linkage_transmission.hpp`).
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Annotated, Literal, Self, get_args

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, model_validator

from mjplug.plugin import OneOrMore, Parameters, PluginError
from mjplug_plugins.joints.scalar_joint import ScalarJoint, require_unique

Array = NDArray[np.float64]

Interface = Literal["position", "velocity", "effort"]
INTERFACES: tuple[Interface, ...] = get_args(Interface)

Side = Literal["joints", "actuators"]

_MIN_REDUCTION, _MAX_REDUCTION = 1e-6, 1e6


def _usable(values: tuple[float, ...]) -> tuple[float, ...]:
    for value in values:
        if not _MIN_REDUCTION <= abs(value) <= _MAX_REDUCTION:
            reason = "a reduction must not be zero" if value == 0.0 else "that is too far from 1"
            raise ValueError(
                f"the reduction {value:g} cannot be used: {reason}; the magnitude must be from {_MIN_REDUCTION:g} to "
                f"{_MAX_REDUCTION:g}"
            )
    return values


Names = Annotated[tuple[str, ...], Field(min_length=1, max_length=2), OneOrMore, AfterValidator(require_unique)]
Reductions = Annotated[tuple[float, ...], OneOrMore, AfterValidator(_usable)]


class TransmissionParameters(Parameters):
    """A transmission of ros2_control; see `transmission_interface`."""

    type: Literal["simple", "differential", "four_bar_linkage"] = Field(
        default="simple", description="`simple` has one joint and one actuator, the others two of each."
    )
    joints: Names = Field(description="The joints.")
    actuators: Names = Field(description="The actuators.")
    joint_reductions: Reductions = Field(default=(), description="Reduction of each joint, not zero; empty: 1.")
    joint_offsets: Annotated[tuple[Annotated[float, Field(ge=-1e6, le=1e6)], ...], OneOrMore] = Field(
        default=(), description="Position of each joint where its actuators are at zero [rad or m]; empty: 0."
    )
    actuator_reductions: Reductions = Field(
        default=(), description="Reduction of each actuator, not zero; empty: 1. Not for `simple`, as in ros2_control."
    )

    @model_validator(mode="after")
    def _has_the_right_numbers(self) -> Self:
        count = 1 if self.type == "simple" else 2
        for name, required in (
            ("joints", True),
            ("actuators", True),
            ("joint_reductions", False),
            ("joint_offsets", False),
            ("actuator_reductions", False),
        ):
            given = len(getattr(self, name))
            if given != count and (required or given):
                raise ValueError(f"{name} has {given} elements; a {self.type} transmission needs {count}")
        if self.type == "simple" and self.actuator_reductions:
            raise ValueError("a simple transmission has no actuator_reductions; set joint_reductions")
        both = [name for name in self.joints if name in self.actuators]
        if both:
            raise ValueError(f"{both[0]!r} is the name of a joint and of an actuator; give them different names")
        return self

    @property
    def matrix(self) -> Array:
        """Actuator coordinates per unit of the joint coordinates, shape (n, n)."""
        count = len(self.joints)
        joint, actuator = self.joint_reductions or (1.0,) * count, self.actuator_reductions or (1.0,) * count
        if self.type == "simple":
            return np.array([[joint[0]]])
        if self.type == "differential":
            return np.array(
                [
                    [actuator[0] * joint[0], actuator[0] * joint[1]],
                    [actuator[1] * joint[0], -actuator[1] * joint[1]],
                ]
            )
        return np.array([[actuator[0] * joint[0], 0.0], [actuator[1], actuator[1] * joint[1]]])


@dataclass(frozen=True, slots=True, eq=False)
class Relation:
    """A transmission, one side of which consists of joints of the model; the other side is derived from it.

    Attributes:
        name: Name of the transmission.
        side: The side that is derived.
        real: The joints of the model, n of them.
        derived: The names of the derived coordinates, n of them.
        to_derived: Matrix, shape (n, n), and offset, shape (n,), from the real to the derived side, by interface.
        to_real: The same from the derived to the real side.
    """

    name: str
    side: Side
    real: tuple[ScalarJoint, ...]
    derived: tuple[str, ...]
    to_derived: Mapping[Interface, tuple[Array, Array]]
    to_real: Mapping[Interface, tuple[Array, Array]]

    def derive(self, interface: Interface, values: Array) -> Array:
        """Returns the derived positions, velocities or efforts, shape (n,).

        Args:
            interface: Kind of the values.
            values: The array of the state, `qpos`, `qvel` or `qfrc_actuator`.
        """
        matrix, offset = self.to_derived[interface]
        own: Array = matrix @ values[[index_of(joint, interface) for joint in self.real]] + offset
        return own


@dataclass(frozen=True, slots=True)
class DerivedJoint:
    """A coordinate that the model does not contain, with the reading methods of a `ScalarJoint`.

    Attributes:
        name: Its name.
        relation: Its transmission.
        row: Its index in the derived side.
    """

    name: str
    relation: Relation
    row: int

    def position(self, data: mujoco.MjData) -> float:
        """Returns its position [rad or m]."""
        return float(self.relation.derive("position", data.qpos)[self.row])

    def velocity(self, data: mujoco.MjData) -> float:
        """Returns its velocity [rad/s or m/s]."""
        return float(self.relation.derive("velocity", data.qvel)[self.row])


def index_of(joint: ScalarJoint, interface: Interface) -> int:
    """Returns the index of a joint in `qpos` (position), or in `qvel` and the force arrays."""
    return joint.qpos if interface == "position" else joint.dof


def relations_of(
    transmissions: Mapping[str, TransmissionParameters], joints: Mapping[str, ScalarJoint]
) -> list[Relation]:
    """Returns the relations of transmissions to the joints of the model.

    Args:
        transmissions: The transmissions by name.
        joints: The hinges and slides of the model by name.

    Raises:
        PluginError: Not exactly one side of a transmission is in the model, or a name is in two transmissions.
    """
    owners: dict[str, str] = {}
    found = []
    for name, given in transmissions.items():
        for member in (*given.joints, *given.actuators):
            if (owner := owners.setdefault(member, name)) != name:
                raise PluginError(f"{member!r} is in two transmissions, {owner!r} and {name!r}")
        found.append(_relation(name, given, joints))
    return found


def _relation(name: str, given: TransmissionParameters, joints: Mapping[str, ScalarJoint]) -> Relation:
    known = {side: [member for member in names if member in joints] for side, names in _sides(given)}
    whole = [side for side, names in _sides(given) if len(known[side]) == len(names)]
    if len(whole) != 1 or any(known[side] for side in known if side not in whole):
        listing = ", ".join(member for members in known.values() for member in members) or "none"
        raise PluginError(
            f"transmission {name!r}: either its joints ({', '.join(given.joints)}) or its actuators "
            f"({', '.join(given.actuators)}) must be hinges or slides of the model, and the others must not; those of "
            f"the model are: {listing}"
        )
    matrix = given.matrix
    inverse: Array = np.linalg.inv(matrix).astype(float)
    zero: Array = np.zeros(len(matrix))
    offsets: Array = np.array(given.joint_offsets or zero, float)
    to_actuators: dict[Interface, tuple[Array, Array]] = {
        "position": (matrix, -matrix @ offsets),
        "velocity": (matrix, zero),
        "effort": (inverse.T, zero),
    }
    to_joints: dict[Interface, tuple[Array, Array]] = {
        "position": (inverse, offsets),
        "velocity": (inverse, zero),
        "effort": (matrix.T, zero),
    }
    if whole == ["joints"]:
        real = tuple(joints[member] for member in given.joints)
        return Relation(name, "actuators", real, given.actuators, to_actuators, to_joints)
    real = tuple(joints[member] for member in given.actuators)
    return Relation(name, "joints", real, given.joints, to_joints, to_actuators)


def _sides(given: TransmissionParameters) -> Iterable[tuple[Side, tuple[str, ...]]]:
    return ("joints", given.joints), ("actuators", given.actuators)
