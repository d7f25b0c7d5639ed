"""Connects a client to the network of a server, or reports why it cannot."""

import json
import os
import re
import time
from dataclasses import dataclass
from pathlib import Path

import zenoh

from mjplug.client.client import Client
from mjplug.client.errors import ClientError, NoServerError, UnknownNameError
from mjplug.client.failure import DEFAULT_ENDPOINT, VARIABLE, examine
from mjplug.client.refusal import refuse_expired, why_refused
from mjplug.client.timeouts import bounded
from mjplug.wire.discovery.announced import NoAnswerError, server_names
from mjplug.wire.zenoh_file import read_zenoh_file, setting

_HANDSHAKE, _LONGEST_HANDSHAKE = 1.0, 4.0
"""Timeout of Zenoh's handshake, at the first attempt and at most [s]."""

_RETRY = 0.1
"""Pause between two attempts [s]."""

_SOURCE_PLACE = re.compile(r" at /\S*?\.rs:\d+\.?")


def connect(
    endpoint: str | None = None,
    *,
    server: str = "",
    timeout: float = 5.0,
    config: str | Path | None = None,
) -> Client:
    """Connects to the network of a server, and waits until a server is running.

    Args:
        endpoint: Where a server or a Zenoh router listens; default: the environment variable MJPLUG_CONNECT, else
            the first endpoint in `config`, else `tcp/127.0.0.1:7447`.
        server: The full name of the server to use for `~`, such as `/robot1/mjplug`; needed only if several servers
            are on the network.
        timeout: How long to wait for a server [s]; 0 makes one attempt, which waits 1 s for an answer.
        config: A Zenoh configuration file, for TLS, passwords and so on.

    Returns:
        The client; close it, or use it in a `with` statement.

    Raises:
        NoServerError: No server answered in time, or it refuses this client; the message says which.
        UnknownNameError: There are servers, but none with this name.
    """
    return open_client(endpoint, server, Timeouts(timeout, timeout), config)


@dataclass(frozen=True, slots=True)
class Timeouts:
    """How long to try to connect.

    Attributes:
        absent: How long to wait if the port refuses connections, or no server is on the network [s].
        slow: How long to wait for a server that accepts connections but does not answer [s].
    """

    absent: float
    slow: float


def open_client(
    endpoint: str | None,
    server: str,
    timeouts: Timeouts,
    config: str | os.PathLike[str] | None,
    kind: type[Client] = Client,
) -> Client:
    """Connects like `connect`, with separate timeouts and a class for the client.

    Args:
        endpoint: As for `connect`.
        server: As for `connect`.
        timeouts: How long to wait.
        config: As for `connect`.
        kind: The class of the client.

    Raises:
        NoServerError: As for `connect`.
        UnknownNameError: As for `connect`.
    """
    server = f"/{server.removeprefix('/')}" if server else ""
    began = time.monotonic()
    timeouts = Timeouts(bounded(timeouts.absent), bounded(timeouts.slow))
    settings = _read(config)
    chosen = _choose(endpoint, settings)
    if config is not None:
        refuse_expired(settings, Path(config))
    _complete(settings, chosen)
    session = _open(settings, chosen, began, timeouts, None if config is None else Path(config))
    try:
        _wait_for_server(session, chosen, server, began, timeouts)
        return kind(session, chosen, server)
    except BaseException:
        # An open session would keep the process from ending.
        session.close()  # type: ignore[no-untyped-call]
        raise


def endpoint_for(endpoint: str | None, config: str | Path | None = None) -> str:
    """Returns the endpoint to which `connect` would connect with these arguments.

    Raises:
        ClientError: The file cannot be used.
    """
    return _choose(endpoint, _read(config))


def _choose(endpoint: str | None, settings: zenoh.Config) -> str:
    return endpoint or os.environ.get(VARIABLE) or _endpoint_in(settings) or DEFAULT_ENDPOINT


def _open(settings: zenoh.Config, endpoint: str, began: float, timeouts: Timeouts, file: Path | None) -> zenoh.Session:
    handshake = _HANDSHAKE
    while True:
        settings.insert_json5("transport/unicast/open_timeout", str(round(handshake * 1e3)))
        attempt = time.monotonic()
        try:
            return zenoh.open(settings)
        except zenoh.ZError:
            now = time.monotonic()
            failure = examine(endpoint, now - began, timed_out=now - attempt >= 0.9 * handshake)
        left = began + (timeouts.slow if failure.slow else timeouts.absent) - time.monotonic()
        if left <= 0.0:
            raise NoServerError(why_refused(settings, file, endpoint) or failure.reason)
        time.sleep(min(_RETRY, left))
        if failure.slow:
            # The server may need longer, as on a busy machine.
            handshake = min(2.0 * handshake, _LONGEST_HANDSHAKE, max(left, _HANDSHAKE))


def _wait_for_server(session: zenoh.Session, endpoint: str, server: str, began: float, timeouts: Timeouts) -> None:
    while True:
        try:
            names = server_names(session)
        except NoAnswerError as error:
            if time.monotonic() >= began + timeouts.slow:
                raise NoServerError(f"{error} at {endpoint}: its server is stopped or overloaded") from None
            continue
        if server in names or (names and not server):
            return
        if time.monotonic() >= began + timeouts.absent:
            break
        time.sleep(_RETRY)
    if names:
        raise UnknownNameError("server", server, names)
    raise NoServerError(
        f"Zenoh answers at {endpoint}, but no mjplug server is on its network; "
        "start one there: mjplug serve bundled:box"
    )


def _read(file: str | os.PathLike[str] | None) -> zenoh.Config:
    try:
        return read_zenoh_file(file)
    except zenoh.ZError as error:
        raise ClientError(f"cannot use the Zenoh configuration file {file}: {_plain(error)}") from None


def _endpoint_in(config: zenoh.Config) -> str | None:
    endpoints = setting(config, "connect/endpoints")
    if isinstance(endpoints, dict):
        # One list for each mode.
        endpoints = endpoints.get("client")
    return str(endpoints[0]) if isinstance(endpoints, list) and endpoints and isinstance(endpoints[0], str) else None


def _complete(config: zenoh.Config, endpoint: str) -> None:
    try:
        config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    except zenoh.ZError:
        raise NoServerError(
            f"{endpoint!r} is not a Zenoh endpoint; write it as protocol/host:port, such as {DEFAULT_ENDPOINT}"
        ) from None
    for key, value in (
        ("mode", "client"),
        ("scouting/multicast/enabled", False),
        # One attempt. With a longer timeout, Zenoh would retry until then, even at a port that refuses connections.
        ("connect/timeout_ms", 0),
    ):
        config.insert_json5(key, json.dumps(value))


def _plain(error: zenoh.ZError) -> str:
    return _SOURCE_PLACE.sub("", str(error)).strip()
