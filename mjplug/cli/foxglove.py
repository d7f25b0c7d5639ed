"""`mjplug foxglove`: shows the network in Foxglove or Lichtblick."""

from typing import TYPE_CHECKING, Annotated

import typer

from mjplug.cli.connected import connected
from mjplug.cli.ending import EndingSignals
from mjplug.cli.output import complain, say

if TYPE_CHECKING:
    from mjplug.client import Client

_LONG = 3600.0


@connected
def foxglove(
    client: "Client",
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, metavar="PORT", help="Port to listen on; 0: any free one.")
    ] = 8765,
    listen: Annotated[
        str, typer.Option("--listen", metavar="ADDRESS", help="Address of this machine to listen on.")
    ] = "127.0.0.1",
    read_only: Annotated[
        bool, typer.Option("--read-only", help="Clients can neither publish, call services nor set parameters.")
    ] = False,
) -> None:
    """Serves topics, services and parameters to Foxglove or Lichtblick until Ctrl-C.

    In Foxglove, choose "Open connection", "Foxglove WebSocket" and the address that is printed.
    """
    from mjplug.errors import MjplugError

    try:
        import foxglove as sdk  # noqa: F401
        import mcap  # noqa: F401
    except ImportError as error:
        raise MjplugError(
            f"this needs the extra `foxglove` ({error.name} is not installed): pip install 'mjplug[foxglove]'"
        ) from None
    from mjplug.foxglove_bridge.bridge import FoxgloveBridge

    with EndingSignals() as signals:
        bridge = FoxgloveBridge(client, listen, port, read_only)
        try:
            say(f"ready · ws://{listen}:{bridge.port} · Ctrl-C ends it")
            if listen not in ("127.0.0.1", "::1", "localhost"):
                complain("warning: every machine that reaches this address can use it, without a password")
            while not signals.wait(_LONG):
                pass
        finally:
            bridge.close()
