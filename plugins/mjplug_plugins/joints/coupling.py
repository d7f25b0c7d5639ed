"""Commands for the derived side of transmissions: several coordinates together become commands of the other side."""

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug_plugins.joints.outputs import Drive
from mjplug_plugins.joints.transmission import INTERFACES, Interface, Relation

Array = NDArray[np.float64]


class CoupledCommands:
    """Commands of one interface for one side of a transmission, which the drives of the other side execute.

    A coordinate that gets no command keeps its last one. Without one, it keeps its position, or gets a velocity or
    effort of zero.

    Attributes:
        interface: Kind of the commands.
        sources: The drives that accept them, n of them.
        pending: Whether commands arrived that `apply` has not passed on yet.
        applying: Whether `apply` is running.

    Args:
        interface: As above.
        targets: The drives that execute them, n of them.
        matrix: Matrix from sources to targets, shape (n, n).
        offset: Added to the result, shape (n,).
        data: The state.
    """

    def __init__(
        self, interface: Interface, targets: Sequence[Drive], matrix: Array, offset: Array, data: mujoco.MjData
    ) -> None:
        self.interface = interface
        self.sources: Sequence[Drive] = ()
        self.pending = self.applying = False
        self._targets, self._matrix, self._offset, self._data = targets, matrix, offset, data
        self._values: Array | None = None

    @property
    def active(self) -> bool:
        """Whether the sources have been commanded since the last other command of the transmission."""
        return self._values is not None

    def set(self, row: int, value: float) -> None:
        """Commands the coordinate with the index `row`."""
        if self._values is None:
            position = self.interface == "position"
            self._values = np.array(
                [drive.joint.position(self._data) if position else 0.0 for drive in self.sources], float
            )
        self._values[row] = value
        self.pending = True

    def apply(self) -> None:
        """Passes the commands on."""
        assert self._values is not None
        self.pending, self.applying = False, True
        try:
            values = (self._matrix @ self._values + self._offset).tolist()
            for drive, value in zip(self._targets, values, strict=True):
                drive.command(self.interface, value)
        finally:
            self.applying = False

    def release(self) -> None:
        """Forgets the commands."""
        self._values, self.pending = None, False
        for drive in self.sources:
            drive.desired = None

    def save(self) -> list[float]:
        """Returns the commands; empty if there are none."""
        return [] if self._values is None else self._values.tolist()

    def restore(self, values: Sequence[float], pending: bool) -> None:
        """Sets what `save` has returned.

        Args:
            values: The commands.
            pending: Whether they have not been passed on yet.
        """
        fits = len(values) == len(self.sources)
        self._values = np.array(values, float) if fits else None
        self.pending = fits and pending


class CoupledOutput:
    """Collects the commands for one coordinate of `CoupledCommands`.

    Args:
        commands: The commands of the transmission.
        row: Index of the coordinate.
    """

    def __init__(self, commands: CoupledCommands, row: int) -> None:
        self._commands, self._row = commands, row

    def command(self, value: float) -> bool:
        """Sets the value to follow from the next step on."""
        self._commands.set(self._row, value)
        return False

    def expire(self) -> None:
        """Sets the value to zero, unless another command replaced it."""
        if self._commands.active:
            self._commands.set(self._row, 0.0)


class Coupling:
    """The drives of both sides of a transmission.

    Args:
        relation: The transmission.
        real: Drives of the joints of the model.
        derived: Drives of the derived coordinates; this class completes their outputs.
        data: The state.
    """

    def __init__(
        self, relation: Relation, real: Sequence[Drive], derived: Sequence[Drive], data: mujoco.MjData
    ) -> None:
        self.name = relation.name
        self.commands: list[CoupledCommands] = []
        for interface in INTERFACES:
            if all(interface in drive.outputs for drive in real):
                self._couple(interface, derived, real, relation.to_real, data)
            elif all(interface in drive.outputs for drive in derived):
                self._couple(interface, real, derived, relation.to_derived, data)
        for drives, others in ((real, derived), (derived, real)):
            for drive in drives:
                drive.others = others
                drive.on_command = self._commanded

    def _couple(
        self,
        interface: Interface,
        sources: Sequence[Drive],
        targets: Sequence[Drive],
        maps: Mapping[Interface, tuple[Array, Array]],
        data: mujoco.MjData,
    ) -> None:
        if any(interface in drive.outputs for drive in sources):
            return
        commands = CoupledCommands(interface, targets, *maps[interface], data)
        commands.sources = sources
        for row, drive in enumerate(sources):
            drive.outputs[interface] = [CoupledOutput(commands, row)]
        self.commands.append(commands)

    def _commanded(self, drive: Drive, interface: Interface) -> None:
        """Ends coupled commands that a command for `drive` replaces."""
        for commands in self.commands:
            continues = commands.interface == interface and drive in commands.sources
            if commands.active and not (commands.applying or continues):
                commands.release()


class Couplings:
    """All couplings of a robot."""

    def __init__(self) -> None:
        self._commands: dict[str, CoupledCommands] = {}

    @property
    def pending(self) -> bool:
        """Whether commands arrived that `apply` has not passed on yet."""
        return any(commands.pending for commands in self._commands.values())

    def add(self, coupling: Coupling) -> None:
        """Adds a coupling."""
        self._commands |= {f"{coupling.name}.{commands.interface}": commands for commands in coupling.commands}

    def apply(self) -> None:
        """Passes on the commands that arrived since the last step."""
        for commands in self._commands.values():
            if commands.pending:
                commands.apply()

    def release(self) -> None:
        """Forgets all commands."""
        for commands in self._commands.values():
            commands.release()

    def save(self) -> dict[str, tuple[list[float], bool]]:
        """Returns the commands that are followed, and whether they have not been passed on yet."""
        return {
            name: (values, commands.pending) for name, commands in self._commands.items() if (values := commands.save())
        }

    def restore(self, saved: Mapping[str, tuple[Sequence[float], bool]]) -> None:
        """Sets what `save` has returned."""
        for name, commands in self._commands.items():
            values, pending = saved.get(name, ((), False))
            commands.restore([float(value) for value in values], bool(pending))
