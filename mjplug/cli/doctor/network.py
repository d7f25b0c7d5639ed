"""Finds out which program uses the endpoint of a server."""

import re
import socket
from collections.abc import Iterator

from mjplug.cli.doctor.finding import Finding

_TOPIC = "network"
_ADDRESS = re.compile(r"(?:tcp|tls)/(?P<host>\[[^\]]*\]|[^:]+):(?P<port>\d+)")
_CONNECT_TIMEOUT = 1.0
"""How long to wait for a connection [s]."""


def check_network(endpoint: str) -> Iterator[Finding]:
    """Yields what is found at the endpoint where a server listens or will listen.

    Args:
        endpoint: The Zenoh endpoint, such as `tcp/127.0.0.1:7447`.
    """
    from mjplug.client import ClientError, NoServerError, connect

    if not listens(endpoint):
        yield Finding(_TOPIC, "ok", f"no program listens at {endpoint}")
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
                str(error),
                "if another program has the port: end it, or serve with --listen tcp/127.0.0.1:0 for any free port",
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
            f"server {name} runs mjplug {there}, but this command is mjplug {here}",
            f"install the same version in both places, for instance here: pip install mjplug=={there}",
        )


def listens(endpoint: str) -> bool:
    """Returns whether a program accepts connections at an endpoint; True for protocols other than TCP and TLS."""
    address = _ADDRESS.match(endpoint)
    if address is None:
        return True
    try:
        with socket.create_connection((address["host"].strip("[]"), int(address["port"])), _CONNECT_TIMEOUT):
            return True
    except (OSError, UnicodeError):
        # A name with an empty or a long label is a UnicodeError.
        return False
