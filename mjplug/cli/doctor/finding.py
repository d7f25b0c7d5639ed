"""The result of one check."""

from dataclasses import dataclass
from typing import Literal

Level = Literal["ok", "note", "warning", "error"]


@dataclass(frozen=True, slots=True)
class Finding:
    """The result of one check.

    Attributes:
        topic: The area: `environment`, `network`, `server`, `scheduling` or `graphics`.
        level: `note` is information; `warning` means slower or fewer functions; `error` means that a function does not
            work.
        message: The result in a sentence.
        fix: How to fix the problem; empty if nothing needs to be done.
    """

    topic: str
    level: Level
    message: str
    fix: str = ""
