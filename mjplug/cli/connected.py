"""Commands that connect to a running server: their common options, and the client."""

import functools
import inspect
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mjplug.cli.interrupt import exit_on_interrupt
from mjplug.cli.names import complete_node

if TYPE_CHECKING:
    from mjplug.client import Client

Endpoint = Annotated[
    str | None,
    typer.Option(
        "--connect",
        "-e",
        metavar="ENDPOINT",
        envvar="MJPLUG_CONNECT",
        help="Endpoint of the server, as in its `ready` line.  [default: tcp/127.0.0.1:7447]",
    ),
]

ZenohConfig = Annotated[
    str | None,
    typer.Option("--zenoh-config", metavar="FILE", help="A Zenoh configuration file: TLS, passwords and so on."),
]

_LONG_ENDPOINT = Annotated[
    str | None,
    typer.Option(
        "--connect",
        metavar="ENDPOINT",
        envvar="MJPLUG_CONNECT",
        help="Endpoint of the server, as in its `ready` line.  [default: tcp/127.0.0.1:7447]",
    ),
]

_SHARED: dict[str, tuple[Any, Any]] = {
    "connect": (Endpoint, None),
    "wait": (
        Annotated[
            float,
            typer.Option(
                "--wait", min=0.0, metavar="SECONDS", help="How long to wait for a server that is not running yet."
            ),
        ],
        0.0,
    ),
    "server": (
        Annotated[
            str,
            typer.Option(
                "--server",
                metavar="NAME",
                help="Server to use for `~` when several are running: /robot1/mjplug.",
                autocompletion=complete_node,
            ),
        ],
        "",
    ),
    "zenoh_config": (ZenohConfig, None),
}


def connected(function: Callable[..., None], short_e: bool = False) -> Callable[..., None]:
    """Turns a function whose first argument is a client into a command: adds options, opens and closes the client.

    Args:
        function: The function.
        short_e: Whether the command uses `-e` for an option of its own, as `ros2 bag record` does; `--connect` then has
            no short form.
    """

    @functools.wraps(function)
    def command(*, connect: str | None, wait: float, server: str, zenoh_config: str | None, **rest: Any) -> None:
        with client(connect, server, zenoh_config, wait) as found:
            function(found, **rest)

    own = list(inspect.signature(function).parameters.values())[1:]
    shared = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
        for name, (annotation, default) in (_SHARED | ({"connect": (_LONG_ENDPOINT, None)} if short_e else {})).items()
    ]
    # typer reads the signature from here; mypy does not know this attribute of functions.
    command.__signature__ = inspect.Signature([*own, *shared])  # type: ignore[attr-defined]
    command.__annotations__ = {parameter.name: parameter.annotation for parameter in [*own, *shared]}
    # Otherwise typer would read the annotations of the function, including that of the client.
    del command.__wrapped__
    return command


_SLOW_TIMEOUT = 5.0
"""Timeout for a server that accepts connections but does not answer, as on a busy machine [s]."""


def client(endpoint: str | None, server: str = "", config: str | None = None, wait: float = 0.0) -> "Client":
    """Returns a client.

    Args:
        endpoint: Where the server listens.
        server: The name of the server; needed if several are on the network.
        config: A Zenoh configuration file.
        wait: How long to wait for a server that is not running [s]; with 0, its absence is reported at once.

    Raises:
        NoServerError: No server is running, or it does not answer.
    """
    with exit_on_interrupt():
        from mjplug.client.connection import Timeouts, open_client

    return open_client(endpoint, server, Timeouts(wait, max(wait, _SLOW_TIMEOUT)), config)
