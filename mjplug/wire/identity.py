"""One server per name: each keeps a liveliness token, and a second one with the same name is refused."""

import logging
from dataclasses import dataclass

import zenoh
from zenoh.handlers import Callback

from mjplug.errors import WireError

_LOG = logging.getLogger(__name__)

TOKENS = "@mjplug"
"""First chunk of the tokens, `@mjplug/<namespace>/<node_name>/<Zenoh id>`: `@mjplug/**` lists all servers."""

_PATIENCE = 2.0
"""How long to wait for tokens [s]; the answer comes within a millisecond unless the network is in trouble."""


def refuse_duplicate(session: zenoh.Session, name: str) -> None:
    """Checks that no server on the network has this name.

    Ask through a client session: a router tells its clients about everybody at once, a peer learns it bit by bit.

    Args:
        session: A session on the network.
        name: The server's full name, such as `/robot1/mjplug`.

    Raises:
        WireError: A server has it.
    """
    for reply in session.liveliness().get(_tokens_of(name), timeout=_PATIENCE):
        if reply.ok is not None:
            raise WireError(
                f"a server named {name} is already on this network (Zenoh id {_holder(reply.ok)}); "
                "stop it, or give this one another node_name or namespace"
            )


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

    def appeared(sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.PUT and (other := _holder(sample)) != own:
            _LOG.error(
                "another server named %s has appeared on this network (Zenoh id %s): requests may reach either; "
                "stop one of them, or give it another node_name or namespace",
                name,
                other,
            )

    liveliness = session.liveliness()
    watcher = liveliness.declare_subscriber(_tokens_of(name), Callback(appeared, indirect=False), history=True)
    return Claim(liveliness.declare_token(f"{TOKENS}{name}/{own}"), watcher)


def _tokens_of(name: str) -> str:
    return f"{TOKENS}{name}/*"


def _holder(sample: zenoh.Sample) -> str:
    return str(sample.key_expr).rpartition("/")[2]
