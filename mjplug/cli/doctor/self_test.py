"""Checks whether a server starts on this machine, and answers."""

from collections.abc import Iterator
from time import perf_counter

from mjplug.cli.doctor.finding import Finding

_TOPIC = "server"
_STEPS = 100


def check_server(model: str = "bundled:arm") -> Iterator[Finding]:
    """Opens a server on a free port of 127.0.0.1, lets a client ask it for steps, and stops it.

    Args:
        model: The model of the server.
    """
    from mjplug import open_server
    from mjplug.client import ClientError
    from mjplug.errors import MjplugError

    began = perf_counter()
    try:
        # Without the environment variables, which `check_environment` checks.
        with open_server(model, paused=True, environ={}) as server, server.client() as client:
            opened = perf_counter()
            answer = client.call("~/step_simulation", steps=_STEPS).message
            answered = perf_counter()
    except (MjplugError, ClientError) as error:
        yield Finding(
            _TOPIC, "error", f"a server cannot be opened in this process: {error}", f"mjplug serve {model} --verbose"
        )
        return
    yield Finding(
        _TOPIC,
        "ok",
        f"a server with {model} starts in {opened - began:.1f} s and answers in {(answered - opened) * 1e3:.0f} ms: "
        f"{answer}",
    )
