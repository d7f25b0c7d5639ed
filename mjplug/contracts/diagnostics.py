"""What a part of the server says of its own state, for `/diagnostics`."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum

from mjplug.errors import is_fault
from mjplug.log import ros_string

_log = logging.getLogger(__name__)


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
        self._failed: set[str] = set()

    def add(self, name: str, task: Callable[[], Diagnosis]) -> None:
        """Adds one to ask about once a second of wall time; a second one of the same name takes its place."""
        self._tasks[name] = task
        self._failed.discard(name)

    def diagnose(self) -> dict[str, Diagnosis]:
        """Asks all of them; every value is text in what they answer.

        One that raises, or answers what is no diagnosis, has an error for a status, and is logged the first time.
        """
        return {name: self._ask(name, task) for name, task in self._tasks.items()}

    def _ask(self, name: str, task: Callable[[], Diagnosis]) -> Diagnosis:
        try:
            said = task()
            if not isinstance(said, Diagnosis):
                raise TypeError(f"a diagnostic returns a Diagnosis, not {said!r}")
            values = {_text(key): _text(value) for key, value in said.values.items()}
            return Diagnosis(Level(said.level), _text(said.message), values)
        except BaseException as error:
            if not is_fault(error):
                raise
            if name not in self._failed:
                self._failed.add(name)
                _log.exception("the diagnostic of %s failed", name)
            return Diagnosis(Level.ERROR, _text(f"its diagnostic failed: {error!r}"))


def _text(value: object) -> str:
    # What is no ROS string, such as an undecodable file name, must not keep the other statuses back.
    return ros_string(f"{value:.6g}" if isinstance(value, float) else str(value))
