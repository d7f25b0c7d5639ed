"""Zenoh endpoints such as `tcp/127.0.0.1:7447`: free ports, and addresses to connect to."""

import re
import socket

from mjplug.errors import WireError

_ADDRESS = re.compile(r"(?P<protocol>[a-z0-9]+)/(?P<host>\[[^\]]*\]|[^:/?#]*):(?P<port>\d+)(?P<rest>[?#].*)?")
_DATAGRAM = ("udp", "quic")
_ANY_TO_LOOPBACK = {"0.0.0.0": "127.0.0.1", "[::]": "[::1]"}


def has_free_port(endpoint: str) -> bool:
    """Returns whether the port of an endpoint is 0, which means any free port: `tcp/127.0.0.1:0`."""
    match = _ADDRESS.fullmatch(endpoint)
    return match is not None and int(match["port"]) == 0


def with_free_port(endpoint: str) -> str:
    """Replaces port 0 by a port that is free now; returns any other endpoint unchanged.

    Zenoh could choose the port itself, but does not report which one it chose.

    Raises:
        WireError: The host is not an address of this machine.
    """
    match = _ADDRESS.fullmatch(endpoint)
    if match is None or int(match["port"]) != 0:
        return endpoint
    host = match["host"].strip("[]")
    kind = socket.SOCK_DGRAM if match["protocol"] in _DATAGRAM else socket.SOCK_STREAM
    try:
        family, _, _, _, address = socket.getaddrinfo(host, 0, type=kind, flags=socket.AI_PASSIVE)[0]
        with socket.socket(family, kind) as probe:
            probe.bind(address)
            port = probe.getsockname()[1]
    except OSError as error:
        raise WireError(f"cannot listen on {endpoint}: {error.strerror or error}") from error
    return _with_port(match, port)


def on_free_port(endpoint: str) -> str:
    """Returns the same endpoint with a port that is free now."""
    match = _ADDRESS.fullmatch(endpoint)
    return endpoint if match is None else with_free_port(_with_port(match, 0))


def dialable(endpoint: str) -> str:
    """Returns the endpoint to which a program on this machine connects: `0.0.0.0` and `[::]` become loopback."""
    match = _ADDRESS.fullmatch(endpoint)
    if match is None or match["host"] not in _ANY_TO_LOOPBACK:
        return endpoint
    return f"{match['protocol']}/{_ANY_TO_LOOPBACK[match['host']]}:{match['port']}{match['rest'] or ''}"


def _with_port(match: re.Match[str], port: int) -> str:
    return f"{match['protocol']}/{match['host']}:{port}{match['rest'] or ''}"
