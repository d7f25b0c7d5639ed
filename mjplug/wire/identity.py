"""Ensures that server names are unique: each server declares a liveliness token with its name."""

import logging
import time
from dataclasses import dataclass

import zenoh

from mjplug.errors import WireError
from mjplug.wire.callbacks import callback
from mjplug.wire.discovery.announced import AT_ONCE, TOKENS, interfaces_key
from mjplug.wire.rejections import Rejections

_LOG = logging.getLogger(__name__)

_QUERY_TIMEOUT = 2.0
"""Timeout of the query for tokens [s]; on a working network it takes less than a millisecond."""

_HOLDER_TIMEOUT = 2.0
"""Timeout for an answer from the holder of a name [s]; a server answers within milliseconds, even under load."""

_RETRY_INTERVAL = 0.1
"""Interval between two queries to the holder [s]."""


def refuse_duplicate(session: zenoh.Session, name: str) -> None:
    """Checks that no other server on the network has this name.

    Any program can declare a token, so the token alone is no proof of a server: its holder is queried for its
    interfaces. If it does not answer within 2 s, a warning is logged and the start continues.

    Use a client session, because a router gives its clients all tokens at once, but a peer discovers them gradually.

    Args:
        session: A client session on the network.
        name: The server's full name, such as `/robot1/mjplug`.

    Raises:
        WireError: Another server has this name.
    """
    until = time.monotonic() + _HOLDER_TIMEOUT
    while (holder := _token_holder(session, name)) is not None:
        if _server_answers(session, name, until - time.monotonic()):
            raise WireError(
                f"a server named {name} is already on this network (Zenoh id {holder}); "
                "stop it, or give this one another namespace, such as --set namespace=robot2"
            )
        if time.monotonic() >= until:
            _LOG.warning(
                "Zenoh id %s announces a server named %s, but did not answer within %g s; this server starts anyway. "
                "If a server of this name hangs, stop it, or give this one another namespace",
                holder,
                name,
                _HOLDER_TIMEOUT,
            )
            return
        time.sleep(_RETRY_INTERVAL)


def _token_holder(session: zenoh.Session, name: str) -> str | None:
    """Returns the Zenoh id in a token of this name; None if there is no token."""
    found = None
    for reply in session.liveliness().get(_tokens_of(name), timeout=_QUERY_TIMEOUT):
        if reply.ok is not None:
            found = found or _holder(reply.ok)
    return found


def _server_answers(session: zenoh.Session, name: str, seconds: float) -> bool:
    """Returns whether a server of this name answers within `seconds` [s]."""
    for reply in session.get(interfaces_key(name), consolidation=AT_ONCE, timeout=max(seconds, _RETRY_INTERVAL)):
        # Any reply proves that a server uses this name.
        del reply
        return True
    return False


@dataclass(frozen=True, slots=True)
class Claim:
    """A server name that this session has claimed, until it is closed.

    Attributes:
        token: The liveliness token.
        watcher: Reports other tokens of the same name.
    """

    token: zenoh.LivelinessToken
    watcher: zenoh.Subscriber[None]


def claim(session: zenoh.Session, name: str) -> Claim:
    """Declares the server's token, and logs an error if another server of the same name appears.

    This can happen if two networks are joined later or if two servers start in the same millisecond. Both keep running.
    """
    own = str(session.zid())
    others = Rejections(f"another server named {name} appeared", logging.ERROR)

    def appeared(sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.PUT and (other := _holder(sample)) != own:
            others.add(
                f"Zenoh id {other} is on this network with the same name, so each request may reach either server; "
                "stop one of them, or give it another namespace"
            )

    liveliness = session.liveliness()
    watcher = liveliness.declare_subscriber(_tokens_of(name), callback(appeared), history=True)
    return Claim(liveliness.declare_token(f"{TOKENS}{name}/{own}"), watcher)


def _tokens_of(name: str) -> str:
    return f"{TOKENS}{name}/*"


def _holder(sample: zenoh.Sample) -> str:
    return str(sample.key_expr).rpartition("/")[2]
