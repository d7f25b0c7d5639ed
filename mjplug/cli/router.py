"""`mjplug router`: a Zenoh router in its own process, to which servers and clients connect."""

import signal
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer

from mjplug.log import logging_to_stderr
from mjplug.wakeup import Flag

_POLL_INTERVAL = 1.0
"""Period at which the main thread wakes up [s]; on Windows, Ctrl-C does not interrupt a wait."""


def router(
    listen: Annotated[
        list[str] | None,
        typer.Option(
            "--listen",
            "-l",
            help="Zenoh endpoint to listen on; port 0 means any free port. Repeatable. Default: tcp/127.0.0.1:7447.",
        ),
    ] = None,
    connect: Annotated[
        list[str] | None,
        typer.Option(
            "--connect", "-e", help="Another Zenoh router to connect to; retried until it succeeds. Repeatable."
        ),
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

    Without one, a server hosts a router itself. A router in its own process keeps running when a server stops: start it
    first, then start each server with --connect and the endpoint of the router.
    """
    from mjplug.wire.session import SessionSettings, open_router

    stopping = Flag()
    with logging_to_stderr(-1 if quiet else verbose):
        session = open_router(
            SessionSettings("router", tuple(listen) if listen else None, tuple(connect or ()), zenoh_config)
        )
        try:
            _stop_on_signals(stopping)
            typer.echo(f"ready · {session.endpoint} · router")
            while not stopping.wait(_POLL_INTERVAL):
                pass
        finally:
            session.close()


def _stop_on_signals(stopping: Flag) -> None:
    def stop(number: int, frame: FrameType | None) -> None:
        stopping.set()
        # Another signal ends the process at once.
        signal.signal(number, signal.SIG_DFL)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop)
