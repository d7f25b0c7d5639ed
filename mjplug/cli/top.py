"""`mjplug top`: live status of a server."""

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
"""Time without a message after which this is shown [s]; the server publishes once a second."""

_OPEN, _CLOSE = "\033[?1049h\033[?25l", "\033[?25h\033[?1049l"
"""Switch to the alternate screen without a cursor, and back."""

_COLOURS = {1: "\033[33m", 2: "\033[31m", 3: "\033[31m"}
_BOLD, _PLAIN = "\033[1m", "\033[0m"


@connected
def top(
    client: "Client",
    once: Annotated[bool, typer.Option("--once", help="Show the status once.")] = False,
    count: Annotated[
        int | None, typer.Option("-n", "--count", min=1, metavar="COUNT", help="Exit after this many updates.")
    ] = None,
) -> None:
    """Shows server status once a second.

    Real-time factor, step times, CPU share and health of each plugin, and rates of topics. Ctrl-C ends it.
    """
    from mjplug.cli.top_table import Line, lines
    from mjplug.client import TimedOutError
    from mjplug_schemas.diagnostic_msgs import DiagnosticArray

    server = client.server.name
    left = 1 if once else count
    if left == 1:
        # The service answers at once; the next message of the topic takes up to a second.
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
                _show([Line(f"{server}: no more messages arrive", 3), *shown])
                continue
            # Other nodes may publish this topic too.
            if any(status.hardware_id == server for status in message.status):
                shown = lines(message, server)
                _show(shown)
                left = None if left is None else left - 1


@contextmanager
def _screen() -> Iterator[None]:
    """Uses the alternate screen of the terminal inside the block; does nothing without a terminal."""
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
    # Overwrites the previous text line by line, which does not flicker.
    text = "\033[K\n".join(_coloured(line, columns) for line in lines[: rows - 1])
    sys.stdout.write(f"\033[H{text}\033[K\033[J")
    sys.stdout.flush()


def _coloured(line: "Line", columns: int) -> str:
    text = "".join(c for c in line.text[:columns] if c.isprintable())
    colour = _BOLD if line.heading else _COLOURS.get(line.level)
    return f"{colour}{text}{_PLAIN}" if colour else text
