"""Who listens where servers listen."""

import re
import socket
from collections.abc import Iterator

from mjplug.cli.doctor.finding import Finding

_TOPIC = "network"
_ADDRESS = re.compile(r"(?:tcp|tls)/(?P<host>\[[^\]]*\]|[^:]+):(?P<port>\d+)")
_CONNECT_TIMEOUT = 1.0
"""How long to wait for a connection [s]."""


def check_network(endpoint: str) -> Iterator[Finding]:
    """Yields what there is to say about the endpoint where a server would listen, or where one should be.

    Args:
        endpoint: Such as `tcp/127.0.0.1:7447`.
    """
    from mjplug.client import ClientError, NoServerError, connect

    if not listens(endpoint):
        yield Finding(_TOPIC, "ok", f"{endpoint} is free: a server can listen there")
        return
    try:
        with connect(endpoint, timeout=0.0) as client:
            servers = client.servers()
    except NoServerError as error:
        if "but no mjplug server" in str(error):
            yield Finding(_TOPIC, "ok", f"a Zenoh router listens on {endpoint}: a server would join it as a peer")
        else:
            yield Finding(
                _TOPIC,
                "error",
                f"a program that does not speak Zenoh listens on {endpoint}",
                "end it, or serve with --listen tcp/127.0.0.1:0 for any free port",
            )
    except ClientError as error:
        yield Finding(_TOPIC, "error", str(error))
    else:
        for name, server in servers.items():
            yield Finding(_TOPIC, "ok", f"server {name} (mjplug {server.version}) answers at {endpoint}")
            yield from _another_version(name, server.version)


def _another_version(name: str, there: str) -> Iterator[Finding]:
    from importlib.metadata import version

    here = version("mjplug")
    if there != here:
        yield Finding(
            _TOPIC,
            "warning",
            f"server {name} is of mjplug {there}, this command of {here}",
            f"pip install mjplug=={there}, here or there",
        )


def listens(endpoint: str) -> bool:
    """Whether a program accepts connections at an endpoint; true of those where only Zenoh itself can tell."""
    address = _ADDRESS.match(endpoint)
    if address is None:
        return True
    try:
        with socket.create_connection((address["host"].strip("[]"), int(address["port"])), _CONNECT_TIMEOUT):
            return True
    except OSError:
        return False
