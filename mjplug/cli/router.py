"""`mjplug router`: a Zenoh router in a process of its own, for servers and clients to meet at."""

import signal
import threading
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer

from mjplug.log import logging_to_stderr

_LOOK = 1.0
"""How often the main thread wakes up [s]; on Windows, Ctrl-C does not interrupt a wait."""


def router(
    listen: Annotated[
        list[str] | None,
        typer.Option(
            "--listen",
            "-l",
            help="Zenoh endpoint to listen on; port 0 takes a free one. Repeatable. Default: tcp/127.0.0.1:7447.",
        ),
    ] = None,
    connect: Annotated[
        list[str] | None,
        typer.Option("--connect", "-e", help="Another Zenoh router to connect to, retried for ever. Repeatable."),
    ] = None,
    zenoh_config: Annotated[
        Path | None,
        typer.Option("--zenoh-config", metavar="FILE", help="A Zenoh configuration file: TLS, users, permissions."),
    ] = None,
    verbose: Annotated[
        int, typer.Option("--verbose", "-v", count=True, show_default=False, help="Log more. Repeatable.")
    ] = 0,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Log warnings and errors only.")] = False,
) -> None:
    """Runs a Zenoh router until Ctrl-C or SIGTERM.

    A server hosts a router itself unless one is there. A router in a process of its own outlives every server: start
    it first, and start each server with --connect and its endpoint.
    """
    from mjplug.wire.session import SessionSettings, open_router

    stopping = threading.Event()
    with logging_to_stderr(-1 if quiet else verbose):
        session = open_router(
            SessionSettings("router", tuple(listen) if listen else None, tuple(connect or ()), zenoh_config)
        )
        try:
            _stop_on_signals(stopping)
            typer.echo(f"ready · {session.endpoint} · router")
            while not stopping.wait(_LOOK):
                pass
        finally:
            session.close()


def _stop_on_signals(stopping: threading.Event) -> None:
    def stop(number: int, frame: FrameType | None) -> None:
        stopping.set()
        # Another signal ends the process at once.
        signal.signal(number, signal.SIG_DFL)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop)
