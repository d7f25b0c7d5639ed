"""Checks that the server answers a request before it reports that it is ready."""

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
    """Sends a request to the server's own `get_parameters` through its session, and handles requests until the answer.

    The request is processed as any other one: Zenoh's routing, decoding, the inbox, the handler on this thread, and the
    thread that sends answers. No step is taken meanwhile.

    Args:
        loop: The loop, which is not running yet. The calling thread becomes the physics thread.
        network: The network on which the services are declared.

    Returns:
        True after the answer; False if the server was interrupted first.

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
        # Another program may have a queryable for the same key that never answers.
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
    reason = f": {reasons[0]}" if reasons else ""
    raise WireError(f"the server's own request to {service} was not answered within {READY_TIME:g} s{reason}")


def _nothing() -> None:
    pass
