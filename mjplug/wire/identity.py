"""One server per name: each keeps a liveliness token, and a second one with the same name is refused."""

import logging
import time
from dataclasses import dataclass

import zenoh

from mjplug.errors import WireError
from mjplug.wire.callbacks import callback
from mjplug.wire.discovery.format import TOKENS
from mjplug.wire.rejections import Rejections
from mjplug_schemas import names

_LOG = logging.getLogger(__name__)

_QUERY_TIMEOUT = 2.0
"""How long to wait for tokens [s]; the answer comes within a millisecond unless the network is in trouble."""

_CHALLENGE = 2.0
"""How long the holder of a name has to answer [s]; a server answers within milliseconds, whatever its physics does."""

_RETRY = 0.1
"""Pause between two questions to the holder [s]."""


def refuse_duplicate(session: zenoh.Session, name: str) -> None:
    """Checks that no server on the network has this name.

    Any program can declare a token, so a token alone does not keep a server from starting: its holder is asked for its
    interfaces. If there is no answer within 2 s, a warning is logged.

    Ask through a client session: a router tells its clients about everybody at once, a peer learns it bit by bit.

    Args:
        session: A session on the network.
        name: The server's full name, such as `/robot1/mjplug`.

    Raises:
        WireError: A server has it.
    """
    until = time.monotonic() + _CHALLENGE
    while (holder := _token_holder(session, name)) is not None:
        if _answers(session, name, until - time.monotonic()):
            raise WireError(
                f"a server named {name} is already on this network (Zenoh id {holder}); "
                "stop it, or give this one another namespace, such as --set namespace=robot2"
            )
        if time.monotonic() >= until:
            _LOG.warning(
                "Zenoh id %s announces a server named %s, but no such server answered within %g s: starting all the "
                "same. If a server of this name hangs, stop it, or give this one another namespace",
                holder,
                name,
                _CHALLENGE,
            )
            return
        time.sleep(_RETRY)


def _token_holder(session: zenoh.Session, name: str) -> str | None:
    """Returns the Zenoh id in a token of the name; None if there is no token."""
    found = None
    for reply in session.liveliness().get(_tokens_of(name), timeout=_QUERY_TIMEOUT):
        if reply.ok is not None:
            found = found or _holder(reply.ok)
    return found


def _answers(session: zenoh.Session, name: str, seconds: float) -> bool:
    """Whether a server of this name answers within a time [s]."""
    # Without consolidation, since Zenoh would keep the reply back until every other program that matches has answered.
    mode = zenoh.ConsolidationMode.NONE
    for reply in session.get(f"{names.key(name)}/interfaces", consolidation=mode, timeout=max(seconds, _RETRY)):
        # Whatever is answered, somebody serves this name.
        del reply
        return True
    return False


@dataclass(frozen=True, slots=True)
class Claim:
    """A name that is ours for as long as the session is open."""

    token: zenoh.LivelinessToken
    watcher: zenoh.Subscriber[None]


def claim(session: zenoh.Session, name: str) -> Claim:
    """Declares the server's token, and keeps an eye on the name.

    Two networks may be joined later, and two servers may start in the same millisecond: then both stay, and both log
    an error.
    """
    own = str(session.zid())
    others = Rejections(f"the name {name} is announced by others too", logging.ERROR)

    def appeared(sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.PUT and (other := _holder(sample)) != own:
            others.add(
                f"another server named {name} has appeared on this network (Zenoh id {other}): requests may reach "
                "either; stop one of them, or give it another namespace"
            )

    liveliness = session.liveliness()
    watcher = liveliness.declare_subscriber(_tokens_of(name), callback(appeared), history=True)
    return Claim(liveliness.declare_token(f"{TOKENS}{name}/{own}"), watcher)


def _tokens_of(name: str) -> str:
    return f"{TOKENS}{name}/*"


def _holder(sample: zenoh.Sample) -> str:
    return str(sample.key_expr).rpartition("/")[2]
