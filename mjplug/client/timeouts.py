"""Timeouts of the client."""

import threading

from mjplug.client.errors import ClientError

_MAX_TIMEOUT = threading.TIMEOUT_MAX / 2
"""Maximum timeout of locks and of Zenoh, with a margin [s]."""


def bounded(timeout: float) -> float:
    """Returns a timeout that locks and Zenoh accept, even for infinity [s].

    Raises:
        ClientError: It is negative or NaN.
    """
    if not timeout >= 0.0:
        raise ClientError(f"the timeout is {timeout!r}; it must be a number of seconds, 0 or more")
    return min(timeout, _MAX_TIMEOUT)
