"""One thing that was looked at."""

from dataclasses import dataclass
from typing import Literal

Level = Literal["ok", "note", "warning", "error"]


@dataclass(frozen=True, slots=True)
class Finding:
    """What was found.

    Attributes:
        topic: What it is about: `environment`, `network`, `server`, `scheduling` or `graphics`.
        level: `note` is worth knowing; `warning` costs something; with an `error`, something does not work.
        message: The sentence.
        fix: What to do; empty if there is nothing to do.
    """

    topic: str
    level: Level
    message: str
    fix: str = ""
