"""Opens a window with MuJoCo's own viewer and shows a server in it."""

import os
import sys
from collections.abc import Callable

import mujoco

from mjplug.client import Client
from mjplug.window.controls import Controls
from mjplug.window.drag import Drag
from mjplug.window.feed import Feed
from mjplug.window.screen import check_screen
from mjplug.window.served import Served
from mjplug.window.stream import States, fetch_model
from mjplug_schemas import names

_FIRST_STUDIO = 4
"""From this major version on, MuJoCo contains Studio."""


def run_window(client: Client, server: str = "", report: Callable[[str], None] | None = None) -> None:
    """Shows a server in a window of MuJoCo's own viewer; returns when the user closes it.

    Space pauses the server, Backspace resets it, the right arrow steps it while it is paused. Ctrl and the right
    mouse button pull a body that was selected with a double click, Ctrl and the left button turn it.

    Args:
        client: A connection to the server.
        server: The server's full name; by default, the only server of the network.
        report: Called with a sentence about each refused request; by default, it is printed to standard error.

    Raises:
        WindowError: There is no screen, the server has another version of MuJoCo, or its model has changed.
        ClientError: The server does not answer.
    """
    check_screen(os.environ)
    name = f"/{server.removeprefix('/')}" if server else client.server.name
    key = names.key(name)
    model = fetch_model(client.session, key)
    controls = Controls(client, name, report or _print)
    states = States(client.session, key)
    drag = Drag(client.session, key)
    try:
        served = Served(name, model, Feed(name, model, states), drag, controls)
        if int(mujoco.__version__.partition(".")[0]) < _FIRST_STUDIO:
            from mjplug.window import passive  # noqa: PLC0415 - each generation of MuJoCo has only one of them

            passive.show(served)
        else:
            from mjplug.window import studio  # noqa: PLC0415

            studio.show(served)
    finally:
        drag.close()
        states.close()
        controls.close()


def _print(sentence: str) -> None:
    print(sentence, file=sys.stderr, flush=True)
