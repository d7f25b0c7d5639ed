"""Checks whether a server is healthy, for health checks of containers and service managers.

A health check runs every few seconds, so it imports the Python client only to explain a failure.
"""

import json
import queue
from time import perf_counter
from typing import TYPE_CHECKING, Any

import typer

from mjplug.cli.connected import client
from mjplug.cli.output import complain, say

if TYPE_CHECKING:
    import zenoh

TIMEOUT = 3.0
"""Time limit for the answer [s]; an answer takes milliseconds."""

_ERROR = 2
"""Level of a status that reports an error, in diagnostic_msgs."""


def check_quickly(endpoint: str | None, server: str, zenoh_config: str | None, timeout: float) -> None:
    """Sends one request that the physics thread answers, and prints the result in one sentence.

    Args:
        endpoint: The endpoint of the server.
        server: The name of the server, needed when several are running.
        zenoh_config: A Zenoh configuration file.
        timeout: How long to wait for the answer [s].

    Raises:
        NoServerError: No server was found.
        TimedOutError: The server did not answer.
        Exit: The server reports errors; the exit code is 1.
    """
    import zenoh

    from mjplug.cli.light_session import light_session
    from mjplug.wire.discovery.announced import NoAnswerError, server_names

    try:
        with light_session(endpoint, zenoh_config) as session:
            names = [name for name in server_names(session) if server.removeprefix("/") in ("", name[1:])]
            if len(names) == 1:
                _ask(session, names[0], timeout)
                return
    except (zenoh.ZError, OSError, NoAnswerError):
        # No server answers, or the file cannot be used.
        pass
    # The Python client explains the failure, and waits longer.
    with client(endpoint, server, zenoh_config) as connected:
        _ask(connected.session, connected.server.name, timeout)


def _ask(session: "zenoh.Session", name: str, timeout: float) -> None:
    began = perf_counter()
    status = _diagnostics(session, name, timeout)
    took = perf_counter() - began
    errors = [f"{entry['name']}: {entry['message']}" for entry in status["status"] if entry["level"] == _ERROR]
    if errors:
        complain(f"unhealthy: {name} reports {'; '.join(errors)}")
        raise typer.Exit(1)
    stamp = status["header"]["stamp"]
    time = stamp["sec"] + stamp["nanosec"] / 1e9
    say(f"healthy: {name} answered after {took * 1e3:.1f} ms, at t = {time:.3f} s")


def _diagnostics(session: "zenoh.Session", name: str, timeout: float) -> Any:
    """Returns a diagnostic_msgs/msg/DiagnosticArray as nested dictionaries."""
    import zenoh
    from zenoh.handlers import Callback

    service = f"{name}/get_diagnostics"
    replies: queue.SimpleQueue[zenoh.Reply | None] = queue.SimpleQueue()
    session.get(
        service[1:],
        Callback(replies.put, drop=lambda: replies.put(None), indirect=False),
        payload=b"{}",
        encoding=zenoh.Encoding.APPLICATION_JSON,
        # Each reply at once: another program that never answers must not delay the reply of the server.
        consolidation=zenoh.ConsolidationMode.NONE,
        # The wait below ends first.
        timeout=timeout + 1.0,
    )
    try:
        reply = replies.get(timeout=timeout)
    except queue.Empty:
        from mjplug.client import TimedOutError

        raise TimedOutError(f"no answer from {service} within {timeout:g} s") from None
    if reply is None:
        from mjplug.client import TimedOutError

        raise TimedOutError(f"{service} did not answer; the server may have stopped, or this client may not call it")
    if reply.ok is None:
        from mjplug.client import RequestRefused

        assert reply.err is not None
        raise RequestRefused(service, reply.err.payload.to_string())
    try:
        return json.loads(json.loads(reply.ok.payload.to_bytes())["message"])
    except (ValueError, KeyError, TypeError):
        from mjplug.client import ClientError

        raise ClientError(f"{service} answered with something other than diagnostics") from None
