"""A part of the server that has state of its own: the server itself, or a plugin instance. Physics thread only."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from numpy.typing import NDArray

from mjplug.physics.scheduler import Timer
from mjplug.physics.steppers import Stepper
from mjplug.physics.velocity import VelocityHold


@dataclass(frozen=True, slots=True)
class SavedPart:
    """The state of a part.

    Attributes:
        values: JSON values by name.
        arrays: Arrays of the plugin, by name; numbers or booleans.
        left_out: Why the state is incomplete; empty if it is complete.
    """

    values: Mapping[str, Any]
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    left_out: str = ""


class Part(Protocol):
    """A part of the server.

    Attributes:
        name: The name of the plugin instance; `~` for the server itself.
        stepper: The part's stepper; None if it has none.
        holds: The velocity holds that the part has created, by number.
        timers: The timers that the part has created and not cancelled, by number.
    """

    name: str

    @property
    def stepper(self) -> Stepper | None:
        """See the class."""

    @property
    def holds(self) -> Sequence[VelocityHold]:
        """See the class."""

    @property
    def timers(self) -> Mapping[int, Timer]:
        """See the class."""

    def reset(self, lineage: int) -> None:
        """Starts the random numbers of the part anew; they then depend on `lineage` only."""

    def save(self) -> SavedPart:
        """Returns a copy of the state, without timers and holds."""

    def check(self, saved: SavedPart) -> str:
        """Returns why a state cannot be restored, as far as this is known before; empty if it probably can be."""

    def restore(self, saved: SavedPart, trial: bool = False) -> str:
        """Restores a state that `check` has accepted.

        Args:
            saved: The state.
            trial: Whether this is only to find out if it can be restored; the present state may be restored then.

        Returns:
            Why it could not be restored, or an empty text.
        """
