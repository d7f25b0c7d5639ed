"""Waits until the publishers of a topic know of a new subscriber."""

from collections.abc import Iterable
from urllib.parse import quote

import zenoh

from mjplug.wire.discovery.announced import AT_ONCE, interfaces_key

_TIMEOUT = 2.0
"""How long to wait for each server [s]; it takes a millisecond, and a slow network somewhat longer."""


def await_publishers(session: zenoh.Session, servers: Iterable[str], key: str) -> None:
    """Returns when each server publishes on `key` for the subscriber that this session has declared.

    A publisher is told of a subscriber on a thread of its own. Without this, a step that is requested right after the
    subscription could end before the publisher sends anything. A server that does not answer in time is skipped:
    the subscription is declared all the same.

    Args:
        session: The session that has declared the subscriber.
        servers: The full names of the servers that publish the topic.
        key: The key that the subscriber reads.
    """
    pending = [
        session.get(f"{interfaces_key(name)}?subscribed={quote(key)}", consolidation=AT_ONCE, timeout=_TIMEOUT)
        for name in servers
    ]
    for replies in pending:
        for reply in replies:
            if reply.ok is not None:
                # A program that is no server may match the key too, and never answer.
                break
