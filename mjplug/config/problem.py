"""What is wrong with a configuration, and where: the file, line and column, or the command line option."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal
from unicodedata import east_asian_width

from mjplug.errors import MjplugError
from mjplug.printable import lines, one_line

_MOST_PROBLEMS = 100
"""How many problems of a configuration the text of the error contains."""

_WIDEST = 160
"""Source lines longer than this are shown in part."""


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """Where a part of the configuration comes from; every one is itself, since comparing whole files would take long.

    Attributes:
        name: As errors show it: `scene.yaml`, `--set sim.speed=-1`, `environment MJPLUG_SIM__SPEED`.
        lines: The text of a file; empty for everything else.
        folder: The folder of a file, from which its relative paths count; None for everything else.
    """

    name: str
    lines: tuple[str, ...] = ()
    folder: Path | None = None


@dataclass(frozen=True, slots=True)
class Mark:
    """A point in a source; line and column count from 1, and line 0 means the source as a whole."""

    source: Source
    line: int = 0
    column: int = 0


@dataclass(frozen=True, slots=True)
class Problem:
    """One thing that is wrong.

    Attributes:
        message: The sentence, without place.
        mark: Where it is.
        hint: A way out, such as `did you mean 'speed'?`; may be empty.
        severity: Warnings do not stop the server.
    """

    message: str
    mark: Mark
    hint: str = ""
    severity: Literal["error", "warning"] = "error"

    def __str__(self) -> str:
        mark, name = self.mark, one_line(self.mark.source.name)
        if not 0 < mark.line <= len(mark.source.lines):
            head = f"{name}: {self.severity}: {lines(self.message)}"
            return f"{head}; {one_line(self.hint)}" if self.hint else head
        head = f"{name}:{mark.line}:{mark.column}: {self.severity}: {lines(self.message)}"
        text, before = _excerpt(mark.source.lines[mark.line - 1], mark.column - 1)
        caret = f"{' ' * 5} | {before}^ {one_line(self.hint)}".rstrip()
        return f"{head}\n{mark.line:>5} | {text}\n{caret}"


class ConfigError(MjplugError):
    """The configuration is wrong; the text has every problem that was found, each with its place.

    Args:
        problems: What is wrong.
    """

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        more = len(self.problems) - _MOST_PROBLEMS
        shown = [str(problem) for problem in self.problems[:_MOST_PROBLEMS]]
        super().__init__("\n".join([*shown, f"… and {more} more"] if more > 0 else shown))


def _excerpt(line: str, column: int) -> tuple[str, str]:
    """Returns what to show of a source line, and the blanks that put a caret below its `column` (from 0)."""
    start = max(0, column - _WIDEST // 2) if len(line) > _WIDEST else 0
    shown = "".join(
        c if c.isprintable() or c == "\t" else "\N{REPLACEMENT CHARACTER}" for c in line[start : start + _WIDEST]
    )
    blanks = "".join(_blank(c) for c in shown[: column - start])
    return shown, blanks + " " * (column - start - len(shown))


def _blank(character: str) -> str:
    if character == "\t":
        return "\t"
    return "  " if east_asian_width(character) in "WF" else " "
