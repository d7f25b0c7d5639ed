"""The view inside a Jupyter notebook."""

from __future__ import annotations

import html
from dataclasses import replace
from typing import TYPE_CHECKING

from mjplug.errors import MjplugError

if TYPE_CHECKING:
    from mjplug.client import Client
    from mjplug.view.background import BackgroundRelay

NEEDS_WEBSOCKETS = "the view needs websockets 14 or later. Install it with: pip install 'mjplug[view]'"


class InlineView:
    """A view that a notebook shows as the result of a cell. It ends with `close`, or with the program.

    Attributes:
        url: The address of the page, for a browser on this machine. It contains a secret.

    Args:
        url: As above.
        height: Height of the page in the notebook [px].
        relay: Serves the page.
    """

    def __init__(self, url: str, height: int, relay: BackgroundRelay) -> None:
        self.url = url
        self._height = height
        self._relay = relay

    def close(self) -> None:
        """Ends the view; a second call does nothing. The client stays open."""
        self._relay.close()

    def __enter__(self) -> InlineView:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<mjplug view at {self.url}>"

    def _repr_html_(self) -> str:
        url = html.escape(self.url, quote=True)
        return (
            f'<iframe src="{url}" width="100%" height="{self._height}" style="border:0" allow="fullscreen; gamepad">'
            f'</iframe><a href="{url}" target="_blank">Open in a tab</a>'
        )


def view(client: Client, *, height: int = 500, port: int = 0, read_only: bool = False) -> InlineView:
    """Shows the simulation in the output of a notebook cell.

    For example:

        from mjplug.client import connect
        from mjplug.view import view

        client = connect()
        view(client)

    The browser must run on the same machine as the notebook, or reach the port by a tunnel.

    Args:
        client: A client of the network to show; close it after the view.
        height: Height of the page in the notebook [px].
        port: The port on 127.0.0.1; 0 means any free port.
        read_only: Whether the page may only look.

    Raises:
        MjplugError: `websockets` is not installed, the page has not been built, or the port is in use.
    """
    try:
        import websockets.asyncio.server  # noqa: F401, PLC0415
    except ImportError:
        raise MjplugError(NEEDS_WEBSOCKETS) from None
    # Not before the check, because these modules need websockets.
    from mjplug.view.access import new_token  # noqa: PLC0415
    from mjplug.view.background import BackgroundRelay  # noqa: PLC0415
    from mjplug.view.built_page import BuiltPage  # noqa: PLC0415
    from mjplug.view.listening import listen  # noqa: PLC0415
    from mjplug.view.relay import Options  # noqa: PLC0415

    page = BuiltPage()
    page.require()
    # The address of the notebook is not known; the token in the path keeps all other pages out.
    options = replace(Options(read_only=read_only), token=new_token(), frame_ancestors="*")
    listening = listen("127.0.0.1", port, search=False)
    relay = BackgroundRelay(client.session, listening, options, page)
    # In the path and not in a cookie, because browsers keep no cookies of a frame from another site.
    return InlineView(f"{listening.url(None)}{options.token}/", height, relay)
