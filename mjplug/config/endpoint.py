"""Validates Zenoh endpoints."""

import re

from mjplug.errors import did_you_mean

_PORTED = ("tcp", "udp", "tls", "quic", "ws")
_PROTOCOLS = (*_PORTED, "unixsock-stream", "unixpipe", "serial", "vsock")


def check_endpoint(text: str) -> str:
    """Returns an endpoint such as `tcp/127.0.0.1:7447` unchanged.

    Raises:
        ValueError: The text is not an endpoint; the message says how to write one.
    """
    if "://" in text:
        raise ValueError(f"write the endpoint {text!r} as {text.replace('://', '/')!r}")
    protocol, slash, address = text.partition("/")
    if not slash or not address:
        raise ValueError(f"{text!r} is not a Zenoh endpoint; write protocol/address, such as tcp/127.0.0.1:7447")
    if protocol not in _PROTOCOLS:
        suggestion = did_you_mean(protocol, _PROTOCOLS)
        raise ValueError(f"unknown protocol {protocol!r} in {text!r}{suggestion}; known: {', '.join(_PROTOCOLS)}")
    port = re.search(r"[^:]:([0-9]{1,5})$", re.split("[?#]", address)[0])
    if protocol in _PORTED and (port is None or int(port[1]) > 65535):
        raise ValueError(f"{text!r} has no valid port; write {protocol}/host:port, such as {protocol}/127.0.0.1:7447")
    return text
