"""What a part of the server says of its own state, for `/diagnostics`."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum


class Level(IntEnum):
    """The levels of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """One status.

    Attributes:
        level: How bad it is.
        message: One sentence.
        values: Figures, by name; they are published as text.
    """

    level: Level = Level.OK
    message: str = "ok"
    values: Mapping[str, object] = field(default_factory=dict)


class Diagnostics:
    """Those who can be asked, by name: `camera` or `camera: front`. Physics thread only."""

    def __init__(self) -> None:
        self._tasks: dict[str, Callable[[], Diagnosis]] = {}

    def add(self, name: str, task: Callable[[], Diagnosis]) -> None:
        """Adds one to ask about once a second of wall time; a second one of the same name takes its place."""
        self._tasks[name] = task

    def diagnose(self) -> dict[str, Diagnosis]:
        """Asks all of them."""
        return {name: task() for name, task in self._tasks.items()}
