"""Finds the listening endpoints of a session that accept other machines without authentication."""

import ipaddress
import json
import re
import socket
from collections.abc import Sequence

import zenoh

_ADDRESS = re.compile(r"(?P<protocol>[a-z0-9_-]+)/(?P<host>\[[^\]]*\]|[^:/?#]*):(?P<port>\d+)(?P<rest>[?#].*)?")
_LOCAL = ("unixsock-stream", "unixpipe", "vsock", "serial")
_TLS = ("tls", "quic", "quic_datagram")
_ADVICE = (
    "any program that can connect to it can command, reset and reconfigure the simulation; "
    "set passwords or client certificates in the Zenoh configuration file (see Security in the documentation), "
    "or listen on 127.0.0.1"
)


def warnings(listening: Sequence[str], config: zenoh.Config) -> list[str]:
    """Returns a warning for each endpoint beyond loopback that requires neither a password nor a client certificate.

    Args:
        listening: The endpoints that a session listens on.
        config: The session's configuration.
    """
    if json.loads(config.get_json("transport/auth/usrpwd/dictionary_file")):
        return []
    mutual_tls = json.loads(config.get_json("transport/link/tls/enable_mtls")) is True
    found = []
    for endpoint in listening:
        match = _ADDRESS.fullmatch(endpoint)
        protocol = endpoint.partition("/")[0]
        if protocol in _LOCAL or (match is not None and _is_loopback(match["host"])):
            continue
        if protocol not in _TLS:
            found.append(f"{endpoint} accepts all clients without authentication or encryption: {_ADVICE}")
        elif not (mutual_tls or (match is not None and "enable_mtls=true" in (match["rest"] or ""))):
            found.append(
                f"{endpoint} is encrypted, but accepts clients without a certificate (no enable_mtls): {_ADVICE}"
            )
    return found


def _is_loopback(host: str) -> bool:
    """Returns whether all addresses of a host are loopback addresses; an unknown host is not."""
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        pass
    try:
        found = {info[4][0] for info in socket.getaddrinfo(host, None)}
    except OSError:
        return False
    return all(ipaddress.ip_address(str(address).partition("%")[0]).is_loopback for address in found)
