"""Velocities that plugins set: written to `qvel` right before a step. Physics thread only."""

from collections.abc import Sequence
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from mjplug.errors import MjplugError


class VelocityHold:
    """Holds the velocities of some degrees of freedom: writes them before every step until changed or released.

    Unlike `velocity_override`, it needs no plugin update before each step, so steps stay in one tight loop.

    Attributes:
        dofs: The degrees of freedom, as indices in `qvel`.
        velocities: The held velocities in the order of `dofs` [m/s, rad/s]; empty while nothing is held.

    Args:
        dofs: The degrees of freedom, as indices in `qvel`.
        nv: Number of degrees of freedom of the model.
        holding: All active holds; this one adds itself while it holds.

    Raises:
        MjplugError: The model has no such degree of freedom.
    """

    __slots__ = ("_holding", "dofs", "velocities")

    def __init__(self, dofs: Sequence[int], nv: int, holding: "list[VelocityHold]") -> None:
        for dof in dofs:
            if not 0 <= dof < nv:
                raise MjplugError(f"degree of freedom {dof} does not exist; the model has {nv}, numbered from 0")
        self.dofs = tuple(dofs)
        self.velocities: tuple[float, ...] = ()
        self._holding = holding

    def set(self, *velocities: float) -> None:
        """Holds velocities from the next step on.

        Args:
            velocities: One for each of `dofs`, in that order [m/s, rad/s].

        Raises:
            ValueError: A velocity is NaN or infinite, or their number is not that of `dofs`.
        """
        # Testing the sum is faster; because a sum of finite numbers may overflow, `_check` tests each one.
        if len(velocities) != len(self.dofs) or not isfinite(sum(velocities)):
            self._check(velocities)
        if velocities and not self.velocities:
            self._holding.append(self)
        self.velocities = velocities

    def release(self) -> None:
        """Stops holding the velocities."""
        if self.velocities:
            self._holding.remove(self)
        self.velocities = ()

    def _check(self, velocities: tuple[float, ...]) -> None:
        if len(velocities) != len(self.dofs):
            raise ValueError(f"got {len(velocities)} velocities for {len(self.dofs)} degrees of freedom; give one each")
        if not all(map(isfinite, velocities)):
            raise ValueError(f"the velocities are {velocities}; all must be finite")


class VelocityOverride:
    """Velocities that replace entries of `qvel` for one step.

    Attributes:
        vector: The velocities, shape (nv,) [m/s, rad/s]; NaN leaves the velocity unchanged.

    Args:
        qvel: The velocities to override, shape (nv,).
    """

    def __init__(self, qvel: NDArray[np.float64]) -> None:
        self.vector = np.full(qvel.shape, np.nan)
        self._qvel = qvel
        self._finite = np.zeros(qvel.shape, bool)
        self._bytes = self.vector.data.cast("B")
        # Copying a memoryview takes a third of the time of `fill`.
        self._none = memoryview(self.vector.tobytes())
        self._saved = memoryview(bytearray(self._none))

    def clear(self) -> None:
        """Sets every entry to NaN."""
        self._bytes[:] = self._none

    def save(self) -> None:
        """Saves the vector, for `restore`."""
        self._saved[:] = self._bytes

    def restore(self) -> None:
        """Restores the saved vector; if none was saved, sets every entry to NaN."""
        self._bytes[:] = self._saved

    def apply(self) -> None:
        """Writes the finite entries to `qvel`."""
        np.isfinite(self.vector, self._finite)
        np.putmask(self._qvel, self._finite, self.vector)
