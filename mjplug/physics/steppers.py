"""What must run before every step: who, in which order, and what a failure means. Physics thread only."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mjplug.errors import is_fault
from mjplug.physics.memory import Saved
from mjplug.physics.simulation import Simulation
from mjplug.physics.velocity import VelocityOverride


class Stepper(Protocol):
    """Something that must run before every step while it is active."""

    def update(self) -> None:
        """Writes controls, forces or velocity overrides for the coming step."""

    def on_reset(self) -> None:
        """Forgets what belonged to the state before the reset."""

    def failed(self, error: BaseException) -> None:
        """Takes an exception that `update` raised; the stepper has been deactivated."""


class Steppers:
    """All steppers, in the order in which they were added: so they are updated, and so they are told of resets.

    Forces that they apply last for one step, and so do velocities that they override.

    Attributes:
        active: Those that are updated before every step.

    Args:
        simulation: Whose steps they are.
    """

    def __init__(self, simulation: Simulation) -> None:
        self.active: tuple[Stepper, ...] = ()
        self._all: list[Stepper] = []
        self._simulation = simulation
        self._override: VelocityOverride | None = None
        self._written: Saved | None = None

    @property
    def velocity_override(self) -> NDArray[np.float64]:
        """Shape (nv,); NaN before each round of updates; finite entries replace velocities right before the step.

        It is looked at from its first use on, so that a server without such plugins does not pay for it.
        """
        if self._override is None:
            self._override = VelocityOverride(self._simulation.data.qvel)
        return self._override.vector

    def add(self, stepper: Stepper) -> None:
        """Adds a stepper, inactive."""
        self._all.append(stepper)

    def activate(self, stepper: Stepper) -> None:
        """Calls the stepper's `update` before every step from now on."""
        self._set_active({*self.active, stepper})

    def deactivate(self, stepper: Stepper) -> None:
        """Stops calling the stepper's `update`."""
        self._set_active({*self.active} - {stepper})

    def update(self) -> None:
        """Lets the active ones write what the coming step needs, each once.

        When one fails, the forces and velocity overrides that it wrote are undone; the others are updated all the same.
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

    def override(self) -> None:
        """Writes the velocities that `update` has left in `velocity_override`."""
        if self._override is not None:
            self._override.apply()

    def on_reset(self) -> None:
        """Clears the forces, and tells every stepper, active or not."""
        self._simulation.clear_forces()
        for stepper in self._all:
            stepper.on_reset()

    def _failed(self, stepper: Stepper, error: BaseException, begun: bool) -> None:
        if not is_fault(error):
            raise error
        self._undo(begun)
        self.deactivate(stepper)
        stepper.failed(error)

    def _save(self) -> None:
        """Notes what the steppers so far have written, in case the next one fails."""
        if self._written is None:
            self._written = Saved((self._simulation.data.xfrc_applied, self._simulation.data.qfrc_applied))
        self._written.save()
        if self._override is not None:
            self._override.save()

    def _undo(self, begun: bool) -> None:
        """Takes back what a stepper wrote before it failed; `begun`: others were updated before it in this step."""
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
