"""Commands that talk to a running server: the options they share, and the client they get."""

import functools
import inspect
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

import typer

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
    "server": (
        Annotated[
            str,
            typer.Option(
                "--server", metavar="NAME", help="What `~` stands for where several servers are: /robot1/mjplug."
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
    def command(*, connect: str | None, server: str, zenoh_config: str | None, **rest: Any) -> None:
        with client(connect, server, zenoh_config) as found:
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


def client(endpoint: str | None, server: str = "", config: str | None = None) -> "Client":
    """Returns a client, or raises at once if nobody is there.

    Raises:
        NoServerError: Nobody is there.
    """
    from mjplug.client import connect

    return connect(endpoint, server=server, timeout=0.0, config=config)
