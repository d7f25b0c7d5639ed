"""Standard output, line by line, without an error if the reader closes the pipe."""

import json
import os
import sys
from collections.abc import Iterable, Sequence
from typing import Any, Literal

import typer

from mjplug.printable import lines, one_line

Format = Literal["yaml", "json", "csv"]


def say(text: str = "") -> None:
    """Prints a line and flushes it. If the pipe is closed, as by `| head -1`, the command exits without an error.

    On a terminal, control characters other than line breaks and tabs are printed as escapes; text to files and pipes is
    not changed.
    """
    if sys.stdout is None:
        # The shell has closed standard output, as in `>&-`.
        return
    try:
        sys.stdout.write(f"{_for_terminal(text) if sys.stdout.isatty() else text}\n")
        sys.stdout.flush()
    except BrokenPipeError:
        # Otherwise Python reports the rest of the buffer as an error when the process exits.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise typer.Exit(0) from None
    except OSError as error:
        complain(f"error: cannot write: {error.strerror}")
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise typer.Exit(1) from None


def say_json(value: Any) -> None:
    """Prints a value as JSON on one line."""
    say(json.dumps(value))


def complain(text: str) -> None:
    """Prints a sentence to standard error, with control characters escaped; further lines of it are indented."""
    print(lines(text), file=sys.stderr, flush=True)


def complain_of(problem: object) -> None:
    """Prints a problem of the configuration to standard error; its text contains line breaks and is escaped already."""
    print(problem, file=sys.stderr, flush=True)


def _for_terminal(text: str) -> str:
    if text.isprintable():
        return text
    return "\n".join("\t".join(one_line(part) for part in line.split("\t")) for line in text.split("\n"))


def table(rows: Iterable[Sequence[object]]) -> list[str]:
    """Returns rows as lines with aligned columns, separated by two spaces."""
    cells = [[str(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)] if cells else []
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in cells]


def say_table(rows: Iterable[Sequence[object]]) -> None:
    """Prints rows with aligned columns."""
    for line in table(rows):
        say(line)
