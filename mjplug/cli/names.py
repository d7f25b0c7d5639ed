"""Names that the TAB key completes: asked from the running server, with nothing imported that takes time."""

import json
import os
from collections.abc import Iterator
from typing import Any

import typer

_PATIENCE_MS = 300
"""How long to wait for a server [ms]: whoever presses TAB waits."""


def complete_topic(context: typer.Context, incomplete: str) -> list[str]:
    """Returns the topics that begin so."""
    return _matching(context, "topics", incomplete)


def complete_service(context: typer.Context, incomplete: str) -> list[str]:
    """Returns the services that begin so."""
    return _matching(context, "services", incomplete)


def complete_type(incomplete: str) -> list[str]:
    """Returns the ROS types that begin so."""
    from mjplug_schemas.registry import all_types

    return [name for name in all_types() if name.startswith(incomplete)]


def complete_plugin(incomplete: str) -> list[str]:
    """Returns the plugin types that begin so."""
    from importlib.metadata import entry_points

    return [point.name for point in entry_points(group="mjplug.plugins") if point.name.startswith(incomplete)]


def _matching(context: typer.Context, kind: str, incomplete: str) -> list[str]:
    try:
        endpoint = context.params.get("connect") or os.environ.get("MJPLUG_CONNECT") or "tcp/127.0.0.1:7447"
        names = {entry["name"] for server in _servers(endpoint) for entry in server[kind]}
    except Exception:
        # Nothing may come between a user and the prompt.
        return []
    return sorted(name for name in names if name.startswith(incomplete))


def _servers(endpoint: str) -> Iterator[dict[str, Any]]:
    import zenoh

    config = zenoh.Config()
    settings = {
        "mode": "client",
        "connect/endpoints": [endpoint],
        "connect/timeout_ms": _PATIENCE_MS,
        "transport/unicast/open_timeout": _PATIENCE_MS,
        "scouting/multicast/enabled": False,
    }
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    with zenoh.open(config) as session:
        tokens = [reply.ok for reply in session.liveliness().get("@mjplug/**", timeout=_PATIENCE_MS / 1e3)]
        for token in tokens:
            if token is None:
                continue
            name = str(token.key_expr).removeprefix("@mjplug/").rpartition("/")[0]
            for reply in session.get(f"{name}/interfaces", timeout=_PATIENCE_MS / 1e3):
                if reply.ok is not None:
                    yield json.loads(reply.ok.payload.to_bytes())
