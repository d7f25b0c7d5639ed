"""Objects that the loop updates before every step, such as plugins. Physics thread only."""

from collections.abc import Collection
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mjplug.errors import is_fault
from mjplug.physics.memory import SavedArrays
from mjplug.physics.simulation import Simulation
from mjplug.physics.velocity import VelocityOverride


class Stepper(Protocol):
    """An object that is updated before every step while it is active."""

    def update(self) -> None:
        """Writes controls, forces or velocity overrides for the next step."""

    def on_reset(self) -> None:
        """Discards data that belongs to the state before the reset."""

    def failed(self, error: BaseException) -> None:
        """Handles an exception that `update` raised; the stepper has already been deactivated."""


class Steppers:
    """All steppers. `update` and `on_reset` call them in the order in which they were added.

    Forces and velocity overrides apply to one step only.

    Attributes:
        active: The steppers that are updated before every step.

    Args:
        simulation: The simulation.
    """

    def __init__(self, simulation: Simulation) -> None:
        self.active: tuple[Stepper, ...] = ()
        self._all: list[Stepper] = []
        self._simulation = simulation
        self._override: VelocityOverride | None = None
        self._written: SavedArrays | None = None

    @property
    def velocity_override(self) -> NDArray[np.float64]:
        """Velocities that replace entries of `qvel` right before the step, shape (nv,) [m/s, rad/s].

        All entries are NaN before the updates; NaN leaves the velocity unchanged. The array is created at its first
        use, so it costs nothing if no plugin uses it.
        """
        if self._override is None:
            self._override = VelocityOverride(self._simulation.data.qvel)
        return self._override.vector

    def add(self, stepper: Stepper) -> None:
        """Adds a stepper; it is inactive at first."""
        self._all.append(stepper)

    def activate(self, stepper: Stepper) -> None:
        """Starts calling the stepper's `update` before every step."""
        self._set_active({*self.active, stepper})

    def deactivate(self, stepper: Stepper) -> None:
        """Stops calling the stepper's `update`."""
        self._set_active({*self.active} - {stepper})

    def update(self) -> None:
        """Calls `update` of every active stepper.

        If one fails, its forces and velocity overrides are undone and it is deactivated; the others are still updated.
        """
        self._simulation.clear_forces()
        if self._override is not None:
            self._override.clear()
        begun = False
        for stepper in self.active:
            if begun:
                self._save()
            try:
                stepper.update()
            except BaseException as error:
                self._failed(stepper, error, begun)
            else:
                begun = True

    def model_changed(self) -> None:
        """Discards the arrays of the previous model."""
        self._override = self._written = None

    def override(self) -> None:
        """Writes the finite entries of `velocity_override` to `qvel`."""
        if self._override is not None:
            self._override.apply()

    def on_reset(self) -> None:
        """Clears the forces and calls `on_reset` of every stepper, active or not."""
        self._simulation.clear_forces()
        for stepper in self._all:
            stepper.on_reset()

    def reset_others(self, restored: Collection[Stepper]) -> None:
        """Calls `on_reset` of every stepper whose state was not restored."""
        for stepper in self._all:
            if stepper not in restored:
                stepper.on_reset()

    def _failed(self, stepper: Stepper, error: BaseException, begun: bool) -> None:
        if not is_fault(error):
            raise error
        self._undo(begun)
        self.deactivate(stepper)
        stepper.failed(error)

    def _save(self) -> None:
        """Saves what the previous steppers have written, in case the next one fails."""
        if self._written is None:
            self._written = SavedArrays((self._simulation.data.xfrc_applied, self._simulation.data.qfrc_applied))
        self._written.save()
        if self._override is not None:
            self._override.save()

    def _undo(self, begun: bool) -> None:
        """Undoes what a failed stepper wrote; `begun` is whether others were updated before it in this step."""
        if begun and self._written is not None:
            self._written.restore()
            if self._override is not None:
                self._override.restore()
        else:
            self._simulation.clear_forces()
            if self._override is not None:
                self._override.clear()

    def _set_active(self, active: set[Stepper]) -> None:
        self.active = tuple(stepper for stepper in self._all if stepper in active)
        if not self.active:
            self._simulation.clear_forces()
