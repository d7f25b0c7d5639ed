"""Zenoh sessions for shell completion, which is too slow with the Python client: its imports take a second."""

import json

import zenoh

from mjplug.wire.zenoh_file import read_zenoh_file, setting

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"


def light_session(endpoint: str | None, file: str | None = None, timeout_ms: int = 2000) -> zenoh.Session:
    """Opens a client's session.

    Args:
        endpoint: Where a server listens; default: the endpoint in the file, or else the default endpoint of servers.
        file: A Zenoh configuration file.
        timeout_ms: Timeout of Zenoh's handshake [ms].

    Raises:
        zenoh.ZError: No server answers, or the file cannot be used.
    """
    config = read_zenoh_file(file)
    settings = {
        "mode": "client",
        # One attempt. With a longer timeout, Zenoh would retry until then, even at a port that refuses connections.
        "connect/timeout_ms": 0,
        "transport/unicast/open_timeout": timeout_ms,
        "scouting/multicast/enabled": False,
    }
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    if endpoint is not None or not setting(config, "connect/endpoints"):
        config.insert_json5("connect/endpoints", json.dumps([endpoint or DEFAULT_ENDPOINT]))
    return zenoh.open(config)
