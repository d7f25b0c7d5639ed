"""The names on running servers, asked for with nothing imported that takes time."""

import json
import os
import re
from collections.abc import Iterator
from typing import Any, Literal

_NAME = re.compile(r"[A-Za-z0-9_/]+")
"""Other names are left out: a shell evaluates what it completes with, and the names come from the network."""

_TIMEOUT_MS = 1000
"""How long to wait for a server [ms]: whoever presses TAB waits."""


def live_names(kind: Literal["topics", "services"], begin: str, endpoint: str | None = None) -> list[str]:
    """Returns the names of topics or services that begin so; none at all if nobody answers.

    Args:
        kind: Which.
        begin: What has been typed of the name.
        endpoint: Where a server listens; by default as for every command.
    """
    try:
        chosen = endpoint or os.environ.get("MJPLUG_CONNECT")
        offered = {str(entry["name"]) for server in _servers(chosen or None) for entry in server[kind]}
    except Exception:
        # Nothing may come between a user and the prompt.
        return []
    return sorted(name for name in offered if name.startswith(begin) and _NAME.fullmatch(name))


def _servers(endpoint: str | None) -> Iterator[dict[str, Any]]:
    import zenoh

    from mjplug.cli.light_session import light_session

    with light_session(endpoint, timeout_ms=_TIMEOUT_MS) as session:
        for reply in session.get(
            "**/interfaces",
            target=zenoh.QueryTarget.ALL,
            # Each reply when it comes: a program that never answers must not keep back those of others.
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=_TIMEOUT_MS / 1e3,
        ):
            if reply.ok is not None:
                yield json.loads(reply.ok.payload.to_bytes())
