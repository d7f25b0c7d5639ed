"""Statuses of the server's parts, for `/diagnostics`."""

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
        level: The severity.
        message: One sentence.
        values: Values by name; they are published as text.
    """

    level: Level = Level.OK
    message: str = "ok"
    values: Mapping[str, object] = field(default_factory=dict)


class Diagnostics:
    """All diagnostic tasks, by name: `camera` or `camera: front`. Physics thread only."""

    def __init__(self) -> None:
        self._tasks: dict[str, Callable[[], Diagnosis]] = {}
        self._failed: set[str] = set()

    def add(self, name: str, task: Callable[[], Diagnosis]) -> None:
        """Adds a task that is called about once a second of wall time; it replaces a task of the same name."""
        self._tasks[name] = task
        self._failed.discard(name)

    def remove(self, name: str) -> None:
        """Removes a task."""
        self._tasks.pop(name, None)

    def diagnose(self) -> dict[str, Diagnosis]:
        """Calls all tasks and returns their statuses by name, with all values converted to text.

        If a task raises an exception or returns something other than a Diagnosis, its status is an error. The first
        failure of each task is logged.
        """
        return {name: self._run(name, task) for name, task in self._tasks.items()}

    def _run(self, name: str, task: Callable[[], Diagnosis]) -> Diagnosis:
        try:
            diagnosis = task()
            if not isinstance(diagnosis, Diagnosis):
                raise TypeError(f"a diagnostic task must return a Diagnosis, not {diagnosis!r}")
            values = {_text(key): _text(value) for key, value in diagnosis.values.items()}
            return Diagnosis(Level(diagnosis.level), _text(diagnosis.message), values)
        except BaseException as error:
            if not is_fault(error):
                raise
            if name not in self._failed:
                self._failed.add(name)
                _log.exception("the diagnostic task of %s failed", name)
            return Diagnosis(Level.ERROR, _text(f"its diagnostic task failed: {error!r}"))


def _text(value: object) -> str:
    # A text that is not a valid ROS string, such as an undecodable file name, must not block the other statuses.
    return ros_string(f"{value:.6g}" if isinstance(value, float) else str(value))
