"""Velocities that plugins dictate: written to `qvel` right before a step. Physics thread only."""

from collections.abc import Sequence
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from mjplug.errors import MjplugError


class VelocityHold:
    """Velocities of a few degrees of freedom, written before every step until they are changed or released.

    Since nobody need be asked before each step, the steps between two events stay one tight loop.

    Attributes:
        dofs: The degrees of freedom.
        velocities: What is held, in their order [m/s, rad/s]; empty if nothing is.

    Args:
        dofs: The degrees of freedom.
        nv: How many the model has.
        holding: Where the hold enters itself while it holds.

    Raises:
        MjplugError: The model has no such degree of freedom.
    """

    __slots__ = ("_holding", "dofs", "velocities")

    def __init__(self, dofs: Sequence[int], nv: int, holding: "list[VelocityHold]") -> None:
        for dof in dofs:
            if not 0 <= dof < nv:
                raise MjplugError(f"the model has no degree of freedom {dof}; its {nv} are numbered from 0")
        self.dofs = tuple(dofs)
        self.velocities: tuple[float, ...] = ()
        self._holding = holding

    def set(self, *velocities: float) -> None:
        """Holds these velocities, in the order of the degrees of freedom, from the coming step on [m/s, rad/s].

        Raises:
            ValueError: One of them is NaN or infinite, or there are more or fewer than degrees of freedom.
        """
        # The sum is the quicker look, but finite numbers may overflow in it.
        if len(velocities) != len(self.dofs) or not isfinite(sum(velocities)):
            self._check(velocities)
        if velocities and not self.velocities:
            self._holding.append(self)
        self.velocities = velocities

    def release(self) -> None:
        """Leaves the velocities to physics again."""
        if self.velocities:
            self._holding.remove(self)
        self.velocities = ()

    def _check(self, velocities: tuple[float, ...]) -> None:
        if len(velocities) != len(self.dofs):
            raise ValueError(f"{len(velocities)} velocities were given to hold {len(self.dofs)} degrees of freedom")
        if not all(map(isfinite, velocities)):
            raise ValueError(f"the velocities to hold are {velocities}; all must be finite")


class VelocityOverride:
    """Velocities for one step, in a vector of which NaN leaves the velocity to physics.

    Attributes:
        vector: Shape (nv,).

    Args:
        qvel: What is overridden.
    """

    def __init__(self, qvel: NDArray[np.float64]) -> None:
        self.vector = np.full(qvel.shape, np.nan)
        self._qvel = qvel
        self._finite = np.zeros(qvel.shape, bool)
        self._bytes = self.vector.data.cast("B")
        # From view to view: a third of what `fill` takes.
        self._none = memoryview(self.vector.tobytes())
        self._saved = memoryview(bytearray(self._none))

    def clear(self) -> None:
        """Leaves every velocity to physics."""
        self._bytes[:] = self._none

    def save(self) -> None:
        """Notes the velocities, for `restore`."""
        self._saved[:] = self._bytes

    def restore(self) -> None:
        """Puts back what was saved last; before the first time, every velocity is left to physics."""
        self._bytes[:] = self._saved

    def apply(self) -> None:
        """Writes the finite ones."""
        np.isfinite(self.vector, self._finite)
        np.putmask(self._qvel, self._finite, self.vector)
