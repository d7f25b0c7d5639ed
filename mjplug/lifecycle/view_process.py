"""The process of `mjplug serve --view`: it serves the page of the simulation view in a browser."""

import contextlib
import importlib.util
import json
import subprocess
import sys
from pathlib import Path

from mjplug.errors import MjplugError
from mjplug.view.built_page import BuiltPage
from mjplug.view.notebook import NEEDS_WEBSOCKETS

_END_TIMEOUT = 0.5
"""Time for the process to end by itself [s]."""


def check_view() -> None:
    """Checks what the process needs.

    Raises:
        MjplugError: `websockets` is not installed, or the page has not been built.
    """
    if importlib.util.find_spec("websockets") is None:
        raise MjplugError(NEEDS_WEBSOCKETS)
    BuiltPage().require()


class ViewProcess:
    """A child process that ends with this one, also if this one is killed: then its standard input is closed.

    It prints the address of the page.

    Args:
        endpoint: The Zenoh endpoint of the server.
        config: The Zenoh configuration file of the server.
        node: The server's full name.
        port: The port of the page; if it is in use, the next free one.
    """

    def __init__(self, endpoint: str, config: Path | None, node: str, port: int) -> None:
        settings = {
            "endpoint": endpoint,
            "config": None if config is None else str(config),
            "node": node,
            "port": port,
        }
        self._process = subprocess.Popen(
            [sys.executable, "-m", "mjplug.view", json.dumps(settings)],
            stdin=subprocess.PIPE,
            # In a separate process group, so that Ctrl-C in a terminal does not reach it.
            process_group=0,
        )

    def close(self) -> None:
        """Ends the process."""
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):
            self._process.stdin.close()
        try:
            self._process.wait(_END_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
