"""Waits until the publishers of a topic have matched a new subscriber."""

from collections.abc import Iterable
from urllib.parse import quote

import zenoh

from mjplug.wire.discovery.announced import AT_ONCE, interfaces_key

_TIMEOUT = 2.0
"""Timeout for each server [s]; the answer takes about a millisecond, longer in a slow network."""


def await_publishers(session: zenoh.Session, servers: Iterable[str], key: str) -> None:
    """Waits until each server has matched the subscriber that this session has declared on `key`.

    Zenoh matches publishers and subscribers asynchronously. Without this, a step that is requested right after the
    subscription could end before the publisher sends anything. A server that does not answer in time is skipped.

    Args:
        session: The session that has declared the subscriber.
        servers: The full names of the servers that publish the topic.
        key: The key that the subscriber reads.
    """
    try:
        pending = [
            session.get(f"{interfaces_key(name)}?subscribed={quote(key)}", consolidation=AT_ONCE, timeout=_TIMEOUT)
            for name in servers
        ]
    except zenoh.ZError:
        # The subscriber may already have received a message, and its callback may have closed the client.
        if session.is_closed():
            return
        raise
    for replies in pending:
        for reply in replies:
            if reply.ok is not None:
                # Another program may have a queryable on this key that never answers.
                break
