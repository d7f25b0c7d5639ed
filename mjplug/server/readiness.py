"""Finds out whether the server answers, before it is called ready."""

import threading
from time import monotonic

import zenoh
from zenoh.handlers import Callback

from mjplug.errors import WireError
from mjplug.physics.loop import Loop
from mjplug.wire.encoding import encoding_of
from mjplug.wire.network import Network
from mjplug_schemas.names import key
from mjplug_schemas.rcl_interfaces import GetParameters

READY_TIME = 30.0
"""Time for the server to answer its own request [s]; it takes milliseconds, and seconds on a busy machine."""


def wait_until_ready(loop: Loop, network: Network) -> bool:
    """Sends a request to the server's own `get_parameters` through its session, and runs the inbox until the answer.

    The request takes the way of every other one: Zenoh's routing, decoding, the inbox, the handler on this thread, the
    thread that sends answers. No step is taken meanwhile.

    Args:
        loop: The loop, which does not run yet. The calling thread becomes the physics thread.
        network: Where the services are declared.

    Returns:
        Whether the answer came; False if a signal stopped the server first.

    Raises:
        WireError: There was no answer in time, or it was an error.
    """
    service = next(entry.service.name for entry in network.listing.services if entry.service.type is GetParameters)
    replies: list[zenoh.Reply] = []
    ended = threading.Event()

    def end() -> None:
        ended.set()
        loop.inbox.post(_nothing)

    network.session.zenoh.get(
        key(service),
        Callback(replies.append, drop=end, indirect=False),
        payload=GetParameters.Request().to_cdr(),
        encoding=encoding_of("cdr", GetParameters.Request),
        # Another program may have a queryable for the same key, and never answer.
        allowed_destination=zenoh.Locality.SESSION_LOCAL,
        timeout=READY_TIME,
    )
    until = monotonic() + READY_TIME
    while not ended.is_set() and not loop.inbox.interrupted and (left := until - monotonic()) > 0.0:
        loop.inbox.wait(left)
        loop.simulation.mark_poses_outdated()
    if loop.inbox.interrupted:
        # The call that stops the loop may have been among those that ran.
        loop.inbox.post(loop.stop)
        return False
    if any(reply.ok is not None for reply in replies):
        return True
    reasons = [reply.err.payload.to_bytes().decode(errors="replace") for reply in replies if reply.err is not None]
    said = f": {reasons[0]}" if reasons else ""
    raise WireError(f"the server's own request to {service} was not answered within {READY_TIME:g} s{said}")


def _nothing() -> None:
    pass
