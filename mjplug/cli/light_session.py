"""Zenoh sessions for commands that have to be quick: the Python client's modules take a second to import."""

import json

import zenoh

from mjplug.wire.zenoh_file import read_zenoh_file, setting

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"


def light_session(endpoint: str | None, file: str | None = None, timeout_ms: int = 2000) -> zenoh.Session:
    """Opens a client's session.

    Args:
        endpoint: Where a server listens; by default what the file says, or else where servers listen by default.
        file: A Zenoh configuration file.
        timeout_ms: How long to wait for a server [ms].

    Raises:
        zenoh.ZError: Nobody is there, or the file cannot be used.
    """
    config = read_zenoh_file(file)
    settings = {
        "mode": "client",
        # One attempt: Zenoh itself would try again until then, also at a port that refuses connections.
        "connect/timeout_ms": 0,
        "transport/unicast/open_timeout": timeout_ms,
        "scouting/multicast/enabled": False,
    }
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    if endpoint is not None or not setting(config, "connect/endpoints"):
        config.insert_json5("connect/endpoints", json.dumps([endpoint or DEFAULT_ENDPOINT]))
    return zenoh.open(config)
