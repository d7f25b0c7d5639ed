"""Why a Zenoh session could not be opened: Zenoh itself reports only that it is not connected."""

import re
import socket
from dataclasses import dataclass

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
"""The endpoint on which a server listens by default."""

VARIABLE = "MJPLUG_CONNECT"
"""The environment variable that sets another endpoint."""

_ADDRESS = re.compile(r"(?:tcp|tls)/(?P<host>\[[^\]]*\]|[^:/?#]+):(?P<port>\d+)")
_LOOPBACK = ("127.0.0.1", "localhost", "[::1]")

_MAX_PORT = 65535

_PROBE_TIMEOUT = 1.0
"""Timeout of a TCP connection [s]."""


@dataclass(frozen=True, slots=True)
class Failure:
    """Why a connection could not be opened.

    Attributes:
        reason: What is wrong and what the user can do.
        slow: Whether a program accepts connections but did not answer in time.
    """

    reason: str
    slow: bool = False


def examine(endpoint: str, waited: float, timed_out: bool) -> Failure:
    """Returns why no session could be opened; connects once more, without Zenoh, to find out.

    Args:
        endpoint: The endpoint to which Zenoh tried to connect.
        waited: Wall time since the first attempt [s].
        timed_out: Whether the handshake of the last attempt timed out.
    """
    match = _ADDRESS.match(endpoint)
    if match is None:
        # Other protocols cannot be tested with a TCP connection, and Zenoh does not report the reason.
        return Failure(f"no mjplug server answers at {endpoint}; {_way_out(endpoint)}", timed_out)
    silent = f"{endpoint} did not answer within {waited:.2g} s"
    if int(match["port"]) > _MAX_PORT:
        return Failure(f"{endpoint}: port {match['port']} is out of range; the highest port is {_MAX_PORT}")
    try:
        socket.create_connection((match["host"].strip("[]"), int(match["port"])), _PROBE_TIMEOUT).close()
    except ConnectionRefusedError:
        return Failure(f"connection refused by {endpoint}: no mjplug server listens there; {_way_out(endpoint)}")
    except TimeoutError:
        return Failure(f"{silent}: its machine is off or not reachable, or a firewall drops the connection", True)
    except UnicodeError:
        return Failure(
            f"cannot connect to {endpoint}: {match['host']!r} is not a valid host name; {_way_out(endpoint)}"
        )
    except OSError as error:
        return Failure(f"cannot connect to {endpoint}: {error.strerror or error}; {_way_out(endpoint)}")
    if timed_out:
        return Failure(
            f"{silent}, but accepts connections: its server is stopped or overloaded, "
            "or another program has the port (mjplug doctor)",
            True,
        )
    return Failure(
        f"{endpoint} accepts connections, but not this client: it may need a certificate or password "
        "(--zenoh-config, or connect(config=...)), or another program has the port (mjplug doctor)"
    )


def _way_out(endpoint: str) -> str:
    at_home = any(host in endpoint for host in _LOOPBACK)
    port = endpoint.rpartition(":")[2]
    start = "mjplug serve bundled:box" + ("" if endpoint == DEFAULT_ENDPOINT else f" --listen {endpoint}")
    far = f"start one there that lets others in (--listen tcp/0.0.0.0:{port}), or"
    return (
        f"{f'start one ({start}), or' if at_home else far} "
        f"give the endpoint that its `ready` line shows (--connect, {VARIABLE}, or connect(endpoint))"
    )
