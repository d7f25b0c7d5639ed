"""Timeouts of the client."""

import threading

from mjplug.client.errors import ClientError

_LONGEST = threading.TIMEOUT_MAX / 2
"""What locks, and Zenoh, can wait for at most, with room for a margin [s]."""


def bounded(timeout: float) -> float:
    """Returns a timeout that locks and Zenoh can wait for, even for infinity [s].

    Raises:
        ClientError: It is negative or no number.
    """
    if not timeout >= 0.0:
        raise ClientError(f"a timeout is a number of seconds from 0 on, not {timeout!r}")
    return min(timeout, _LONGEST)
