"""Commands that talk to a running server: the options they share, and the client they get."""

import functools
import inspect
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mjplug.cli.interrupt import exit_on_interrupt
from mjplug.cli.names import complete_node

if TYPE_CHECKING:
    from mjplug.client import Client

_SHARED = {
    "connect": (
        Annotated[
            str | None,
            typer.Option(
                "--connect",
                "-e",
                metavar="ENDPOINT",
                envvar="MJPLUG_CONNECT",
                help="Where the server listens, as its `ready` line says.  [default: tcp/127.0.0.1:7447]",
            ),
        ],
        None,
    ),
    "wait": (
        Annotated[
            float,
            typer.Option(
                "--wait", min=0.0, metavar="SECONDS", help="How long to wait for a server that is not there yet."
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
    "zenoh_config": (
        Annotated[
            str | None,
            typer.Option(
                "--zenoh-config", metavar="FILE", help="A Zenoh configuration file: TLS, passwords and so on."
            ),
        ],
        None,
    ),
}


def connected(function: Callable[..., None]) -> Callable[..., None]:
    """Makes a command of a function whose first argument is a client: adds the options for it, and closes it."""

    @functools.wraps(function)
    def command(*, connect: str | None, wait: float, server: str, zenoh_config: str | None, **rest: Any) -> None:
        with client(connect, server, zenoh_config, wait) as found:
            function(found, **rest)

    own = list(inspect.signature(function).parameters.values())[1:]
    shared = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
        for name, (annotation, default) in _SHARED.items()
    ]
    # What typer reads; functions have it only once it is set.
    command.__signature__ = inspect.Signature([*own, *shared])  # type: ignore[attr-defined]
    command.__annotations__ = {parameter.name: parameter.annotation for parameter in [*own, *shared]}
    # Otherwise the function's own annotations would be looked at, the client's among them.
    del command.__wrapped__
    return command


_SLOW = 5.0
"""How long to wait for a server that accepts connections and does not answer [s], as on a busy machine."""


def client(endpoint: str | None, server: str = "", config: str | None = None, wait: float = 0.0) -> "Client":
    """Returns a client.

    Args:
        endpoint: Where the server listens.
        server: Its name, where several are on the network.
        config: A Zenoh configuration file.
        wait: How long to wait for a server that is not there [s]; with 0, that is reported at once.

    Raises:
        NoServerError: No server is there, or it does not answer.
    """
    with exit_on_interrupt():
        from mjplug.client.connection import Timeouts, open_client

    return open_client(endpoint, server, Timeouts(wait, max(wait, _SLOW)), config)
