"""The view that `mjplug serve --view` starts as a child process: it ends when its standard input is closed.

The only argument is a JSON object: `endpoint`, `config` (a Zenoh configuration file or null), `node` and `port`.
"""

import json
import os
import sys

from mjplug.errors import MjplugError
from mjplug.log import logging_to_stderr
from mjplug.view.listening import listen
from mjplug.view.relay import Options
from mjplug.view.server import Connecting, serve_view


def main(argument: str) -> int:
    """Serves the page of one server; returns the exit code."""
    settings = json.loads(argument)
    try:
        listening = listen("127.0.0.1", settings["port"])
        if settings["port"] not in (0, listening.port):
            _say(sys.stderr, f"port {settings['port']} is in use, so the view is at port {listening.port}")
        connecting = Connecting(settings["endpoint"], settings["config"], float("inf"), lambda reason: None)
        with logging_to_stderr(-1):
            serve_view(
                connecting,
                listening,
                Options((settings["node"],)),
                lambda url: _say(sys.stdout, f"view · {url}"),
                until_closed=sys.stdin.fileno(),
            )
    except MjplugError as error:
        _say(sys.stderr, f"the view ended: {error}")
        return 1
    return 0


def _say(stream: object, text: str) -> None:
    # The shell may have closed the stream, or the reader the pipe.
    try:
        print(text, file=stream, flush=True)  # type: ignore[call-overload]
    except (OSError, ValueError):
        return


if __name__ == "__main__":
    code = main(sys.argv[1])
    # The thread that connects may be inside Zenoh, where Python cannot end it.
    os._exit(code)
