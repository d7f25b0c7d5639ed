"""`mjplug view`: the simulation in a browser."""

import os
import re
import sys
from pathlib import Path
from typing import Annotated

import typer

from mjplug.cli.connected import Endpoint, ZenohConfig, client
from mjplug.cli.interrupt import exit_on_interrupt
from mjplug.cli.names import complete_node
from mjplug.cli.output import complain, say
from mjplug.errors import MjplugError
from mjplug.lifecycle.ending import QuickEnd
from mjplug.limits import DEFAULT_VIEW_PORT


def view(
    connect: Endpoint = None,
    node: Annotated[
        list[str] | None,
        typer.Option(
            "--node",
            metavar="NAME",
            help="Show only this server, such as /robot1/mjplug. Repeatable. Default: all servers of the network.",
            autocompletion=complete_node,
        ),
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(
            min=0, max=65535, help="Port of the page; 0 means any free port.  [default: 8080, or the next free one]"
        ),
    ] = None,
    listen: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="Address of this machine to listen on; 0.0.0.0 lets other machines in, with the token in the URL.",
        ),
    ] = "127.0.0.1",
    origin: Annotated[
        list[str] | None,
        typer.Option(
            "--origin",
            metavar="URL",
            help="Accept the page from a reverse proxy at this origin: https://example.org. Repeatable.",
        ),
    ] = None,
    read_only: Annotated[
        bool, typer.Option("--read-only", help="Only show: no drags, no messages, no services that change anything.")
    ] = False,
    open_browser: Annotated[
        bool | None,
        typer.Option(
            "--open/--no-open",
            show_default=False,
            help="Open the page in a browser.  [default: if this is a terminal on a desktop]",
        ),
    ] = None,
    window: Annotated[
        bool,
        typer.Option(
            "--window", help="Use MuJoCo's own window instead of a browser; needs the MuJoCo version of the server."
        ),
    ] = False,
    record: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.html",
            dir_okay=False,
            help="Record into one HTML file, which any browser plays without a server; Ctrl-C completes it.",
        ),
    ] = None,
    duration: Annotated[
        float | None,
        typer.Option(min=0.1, metavar="SECONDS", help="With --record: wall time to record.  [default: until Ctrl-C]"),
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(min=0.1, max=60.0, metavar="HZ", help="With --record: maximum frames per second.  [default: 30]"),
    ] = None,
    wait: Annotated[
        float | None,
        typer.Option(min=0.0, metavar="SECONDS", help="How long to wait for a server.  [default: without limit]"),
    ] = None,
    zenoh_config: ZenohConfig = None,
) -> None:
    """Shows the simulation in a browser, from any machine.

    Serves a page with the servers of a network until Ctrl-C. It needs neither MuJoCo nor a graphics card.
    """
    if record is None and (duration is not None or rate is not None):
        raise MjplugError("--duration and --rate belong to --record FILE.html")
    if window and record is not None:
        raise MjplugError("--window and --record exclude each other; run the command twice")
    if record is not None:
        _record(connect, node or [], zenoh_config, wait or 0.0, record, rate, duration)
        return
    if window:
        _window(connect, node or [], zenoh_config, wait or 0.0)
        return
    ending = QuickEnd()
    with exit_on_interrupt():
        _import_websockets()
        from mjplug.log import logging_to_stderr
        from mjplug.view.listening import listen as listen_on
        from mjplug.view.relay import Options
        from mjplug.view.server import Connecting, serve_view

    nodes = tuple(f"/{name.removeprefix('/')}" for name in node or ())
    options = Options(nodes, read_only, tuple(map(_origin, origin or ())))
    wanted = DEFAULT_VIEW_PORT if port is None else port
    listening = listen_on(listen, wanted)
    if wanted not in (0, listening.port):
        complain(f"port {wanted} is in use, so the page is at port {listening.port}")

    def ready(url: str) -> None:
        say(f"ready · {url}")
        _open(url, open_browser)

    connecting = Connecting(connect, zenoh_config, float("inf") if wait is None else wait, _say_waiting, nodes)
    with logging_to_stderr(0):
        serve_view(connecting, listening, options, ready)
    # The thread that connects may be inside Zenoh, where Python cannot end it.
    ending.code = 0


def _origin(text: str) -> str:
    """Returns an origin as browsers write it.

    Raises:
        BadParameter: It is not one.
    """
    match = re.fullmatch(r"(https?://[^/?#@\s]+)/?", text.lower())
    if match is None:
        raise typer.BadParameter(
            f"{text!r} is not an origin; write it as https://example.org or http://host:8000", param_hint="--origin"
        )
    return match[1]


def _say_waiting(reason: str) -> None:
    complain(f"waiting for a server: {reason}")


def _only(nodes: list[str], what: str) -> str:
    """Returns the one server that was chosen; empty if none was."""
    if len(nodes) > 1:
        raise MjplugError(f"{what} shows one server, but {len(nodes)} are given with --node")
    return nodes[0] if nodes else ""


def _record(
    endpoint: str | None,
    nodes: list[str],
    zenoh_config: str | None,
    wait: float,
    path: Path,
    rate: float | None,
    duration: float | None,
) -> None:
    server = _only(nodes, "a recording")
    with exit_on_interrupt():
        from mjplug.view.recorder import Limits, Progress, record

    limits = Limits(30.0 if rate is None else rate, float("inf") if duration is None else duration)
    live = sys.stderr is not None and sys.stderr.isatty()

    def text(progress: Progress) -> str:
        lost = f", {progress.lost} lost" if progress.lost else ""
        return f"{progress.seconds:.1f} s, {progress.frames} frames{lost}, {progress.size / 1e6:.2f} MB"

    def report(progress: Progress) -> None:
        if live:
            silent = " · the server sends nothing" if progress.silent else ""
            # Clears the rest of the line.
            sys.stderr.write(f"\rrecording · {text(progress)}{silent}\033[K")
            sys.stderr.flush()

    with client(endpoint, server, zenoh_config, wait) as found:
        name = f"/{server.removeprefix('/')}" if server else found.server.name
        done = record(found, name, path, limits, report)
    if live:
        sys.stderr.write("\r\033[K")
    say(f"{path}: {text(done)}")


def _window(endpoint: str | None, nodes: list[str], zenoh_config: str | None, wait: float) -> None:
    server = _only(nodes, "a window")
    with exit_on_interrupt():
        from mjplug.window import run_window
        from mjplug.window.screen import check_screen

    check_screen(os.environ)
    with client(endpoint, server, zenoh_config, wait) as found:
        run_window(found, report=complain)


def _import_websockets() -> None:
    try:
        import websockets.asyncio.server  # noqa: F401
    except ImportError:
        from mjplug.view.notebook import NEEDS_WEBSOCKETS

        raise MjplugError(NEEDS_WEBSOCKETS) from None


def _open(url: str, wanted: bool | None) -> None:
    display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    desktop = sys.platform in ("darwin", "win32") or bool(display)
    if wanted is False or (wanted is None and not (desktop and sys.stdout is not None and sys.stdout.isatty())):
        return
    if not desktop:
        complain("there is no desktop (DISPLAY and WAYLAND_DISPLAY are not set), so no browser was opened")
        return
    import webbrowser

    if not webbrowser.open(url):
        complain("no browser was found; open the page yourself")
