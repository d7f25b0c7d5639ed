"""The joints that a message contains, some of which are derived from others by transmissions."""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mjplug_plugins.joints.scalar_joint import ScalarJoint
from mjplug_plugins.joints.transmission import DerivedJoint, Interface, Relation, Side, index_of

Coordinate = ScalarJoint | DerivedJoint


def coordinates_of(joints: Sequence[ScalarJoint], relations: Sequence[Relation], side: Side) -> dict[str, Coordinate]:
    """Returns one side of the robot by name: joints of the model, or what is derived from them, in their places.

    Args:
        joints: The joints of the model, in the order of the result.
        relations: The transmissions.
        side: `joints` or `actuators`. Joints without a transmission belong to both.
    """
    replaced = {
        joint.name: DerivedJoint(name, relation, row)
        for relation in relations
        if relation.side == side
        for row, (joint, name) in enumerate(zip(relation.real, relation.derived, strict=True))
    }
    return {found.name: found for joint in joints for found in (replaced.get(joint.name, joint),)}


def copying(
    coordinates: Sequence[Coordinate], interface: Interface, source: NDArray[np.float64], target: NDArray[Any]
) -> Callable[[], object]:
    """Returns a function that copies the state of coordinates into a message.

    Args:
        coordinates: The coordinates in the order of the message.
        interface: Kind of the values.
        source: The array of the state: `qpos`, `qvel` or `qfrc_actuator`.
        target: The numbers of the message, shape (n,).
    """
    plain = [
        (row, index_of(joint, interface)) for row, joint in enumerate(coordinates) if isinstance(joint, ScalarJoint)
    ]
    if len(plain) == len(coordinates):
        return _block(source, [index for _, index in plain], target)
    return _Mixed(coordinates, interface, plain, source, target)


class _Mixed:
    """Copies plain joints, and computes the derived ones with one matrix."""

    def __init__(
        self,
        coordinates: Sequence[Coordinate],
        interface: Interface,
        plain: list[tuple[int, int]],
        source: NDArray[np.float64],
        target: NDArray[Any],
    ) -> None:
        self._source, self._target = source, target
        self._plain_rows = np.array([row for row, _ in plain], np.intp)
        self._plain = np.array([index for _, index in plain], np.intp)
        derived = [(row, joint) for row, joint in enumerate(coordinates) if isinstance(joint, DerivedJoint)]
        needed = list(dict.fromkeys(joint for _, found in derived for joint in found.relation.real))
        self._rows = np.array([row for row, _ in derived], np.intp)
        self._needed = np.array([index_of(joint, interface) for joint in needed], np.intp)
        self._matrix = np.zeros((len(derived), len(needed)))
        self._offset = np.zeros(len(derived))
        for number, (_, found) in enumerate(derived):
            matrix, offset = found.relation.to_derived[interface]
            self._offset[number] = offset[found.row]
            for column, joint in enumerate(found.relation.real):
                self._matrix[number, needed.index(joint)] = matrix[found.row, column]

    def __call__(self) -> None:
        self._target[self._plain_rows] = self._source[self._plain]
        self._target[self._rows] = self._matrix @ self._source[self._needed] + self._offset


def _block(source: NDArray[np.float64], indices: list[int], target: NDArray[Any]) -> Callable[[], object]:
    """Returns a function that copies elements of an array; contiguous elements, which are common, in one block."""
    if all(b == a + 1 for a, b in pairwise(indices)):
        from_, to = source.data.cast("B").cast("d")[indices[0] : indices[-1] + 1], target.data.cast("B").cast("d")
        return partial(to.__setitem__, slice(None), from_)
    return partial(source.take, np.array(indices, np.intp), out=target, mode="clip")
