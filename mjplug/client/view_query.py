"""Queries the parts of a server's simulation view that it makes at the first query."""

from time import monotonic, sleep

import zenoh

from mjplug.client.errors import ClientError, TimedOutError
from mjplug.wire.discovery.announced import AT_ONCE, TIMEOUT_TEXT

NO_REPLY_TIME = 10.0
"""How long a query that ends without a reply is repeated [s]: a server is announced before it answers."""

_RETRY = 0.5
"""Pause before a query is repeated [s]."""


def query(session: zenoh.Session, key: str, timeout: float) -> zenoh.Sample:
    """Returns the reply of a server.

    Args:
        session: The session.
        key: The key, such as `robot1/mjplug/@view/scene`.
        timeout: How long to wait for the reply [s].

    Raises:
        ClientError: The server refuses; the text is its reason.
        TimedOutError: The server does not answer in time, or nobody answers on this key.
    """
    began = monotonic()
    while True:
        for reply in session.get(key, consolidation=AT_ONCE, timeout=timeout):
            if reply.ok is not None:
                return reply.ok
            reason = "" if reply.err is None else reply.err.payload.to_string()
            if reason != TIMEOUT_TEXT:
                raise ClientError(reason)
            raise TimedOutError(f"no answer from {key} within {timeout:g} s; its server may be busy")
        if monotonic() - began >= NO_REPLY_TIME:
            raise TimedOutError(f"nobody answers on {key}; its server may have stopped, or may be an older version")
        sleep(_RETRY)
