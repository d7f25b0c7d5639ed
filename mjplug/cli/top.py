"""`mjplug top`: how a server is, live."""

import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

from mjplug.cli.connected import connected
from mjplug.cli.output import say

if TYPE_CHECKING:
    from mjplug.cli.top_table import Line
    from mjplug.client import Client

_MESSAGE_TIMEOUT = 3.0
"""How long nothing may come until one is told [s]; the server sends once a second."""

_OPEN, _CLOSE = "\033[?1049h\033[?25l", "\033[?25h\033[?1049l"
"""Another screen without a cursor; and back."""

_COLOURS = {1: "\033[33m", 2: "\033[31m", 3: "\033[31m"}
_BOLD, _PLAIN = "\033[1m", "\033[0m"


@connected
def top(
    client: "Client",
    once: Annotated[bool, typer.Option("--once", help="Show it once.")] = False,
    count: Annotated[
        int | None, typer.Option("-n", "--count", min=1, metavar="COUNT", help="End after so many times.")
    ] = None,
) -> None:
    """Shows how a server is, once a second.

    Real-time factor, step times, what plugins take and how they fare, and how often topics come. Ends with Ctrl-C.
    """
    from mjplug.cli.top_table import Line, lines
    from mjplug.client import TimedOutError
    from mjplug_schemas.diagnostic_msgs import DiagnosticArray

    server = client.server.name
    left = 1 if once else count
    if left == 1:
        # At once, and about the last second; the topic would have to be waited for.
        answer = client.call(f"{server}/get_diagnostics")
        say("\n".join(line.text for line in lines(DiagnosticArray.from_json(answer.message), server)))
        return
    with client.subscribe("/diagnostics", DiagnosticArray, depth=4) as messages, _screen():
        shown: list[Line] = []
        while left != 0:
            try:
                message = messages.next(_MESSAGE_TIMEOUT)
            except TimedOutError:
                if not sys.stdout.isatty():
                    raise
                _show([Line(f"{server}: nothing comes any more", 3), *shown])
                continue
            # Others on the network have this topic too.
            if any(status.hardware_id == server for status in message.status):
                shown = lines(message, server)
                _show(shown)
                left = None if left is None else left - 1


@contextmanager
def _screen() -> Iterator[None]:
    """Takes another screen of the terminal until the end of the block; does nothing where there is no terminal."""
    if not sys.stdout.isatty():
        yield
        return
    sys.stdout.write(_OPEN)
    try:
        yield
    finally:
        sys.stdout.write(_CLOSE)
        sys.stdout.flush()


def _show(lines: "list[Line]") -> None:
    if not sys.stdout.isatty():
        say("\n".join(line.text for line in lines) + "\n")
        return
    columns, rows = shutil.get_terminal_size()
    # Over what was there, and each line to its end: without flicker.
    text = "\033[K\n".join(_coloured(line, columns) for line in lines[: rows - 1])
    sys.stdout.write(f"\033[H{text}\033[K\033[J")
    sys.stdout.flush()


def _coloured(line: "Line", columns: int) -> str:
    text = "".join(c for c in line.text[:columns] if c.isprintable())
    colour = _BOLD if line.heading else _COLOURS.get(line.level)
    return f"{colour}{text}{_PLAIN}" if colour else text
