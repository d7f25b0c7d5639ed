"""Problems of a configuration, with their place: file, line and column, or command line option."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal
from unicodedata import east_asian_width

from mjplug.errors import MjplugError
from mjplug.printable import lines, one_line

_MAX_SHOWN_PROBLEMS = 100
"""Maximum number of problems in the text of an error."""

_MAX_LINE_LENGTH = 160
"""Maximum length of a source line that is shown in full [characters]."""


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """The source of a part of the configuration. Compared by identity, because comparing files would take long.

    Attributes:
        name: Name for error messages: `scene.yaml`, `--set sim.speed=-1`, `environment MJPLUG_SIM__SPEED`.
        lines: The lines of a file; empty for other sources.
        folder: The folder of a file, for its relative paths; None for other sources.
    """

    name: str
    lines: tuple[str, ...] = ()
    folder: Path | None = None


@dataclass(frozen=True, slots=True)
class Mark:
    """A position in a source. Line and column count from 1; line 0 means the whole source."""

    source: Source
    line: int = 0
    column: int = 0


@dataclass(frozen=True, slots=True)
class Problem:
    """An error or a warning about a configuration.

    Attributes:
        message: The sentence, without the place.
        mark: The place.
        hint: A remedy, such as `did you mean 'speed'?`; may be empty.
        severity: `error` prevents a start, `warning` does not.
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
    """The configuration is invalid. The text contains the problems with their places.

    Attributes:
        problems: All problems.

    Args:
        problems: All problems.
    """

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        more = len(self.problems) - _MAX_SHOWN_PROBLEMS
        shown = [str(problem) for problem in self.problems[:_MAX_SHOWN_PROBLEMS]]
        super().__init__("\n".join([*shown, f"… and {more} more"] if more > 0 else shown))


def _excerpt(line: str, column: int) -> tuple[str, str]:
    """Returns the shown part of a source line, and the indentation of a caret below its `column` (from 0)."""
    start = max(0, column - _MAX_LINE_LENGTH // 2) if len(line) > _MAX_LINE_LENGTH else 0
    shown = "".join(
        c if c.isprintable() or c == "\t" else "\N{REPLACEMENT CHARACTER}"
        for c in line[start : start + _MAX_LINE_LENGTH]
    )
    blanks = "".join(_blank(c) for c in shown[: column - start])
    return shown, blanks + " " * (column - start - len(shown))


def _blank(character: str) -> str:
    if character == "\t":
        return "\t"
    return "  " if east_asian_width(character) in "WF" else " "
