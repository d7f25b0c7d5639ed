"""Finds the names of the servers on a network, and their lists of interfaces as JSON text.

Imports little, because shell completion uses it.
"""

import time
from collections.abc import Iterator

import zenoh

from mjplug_schemas.errors import NameRuleError
from mjplug_schemas.names import key, validate_name

TOKENS = "@mjplug"
"""First chunk of liveliness tokens, `@mjplug/<namespace>/<node_name>/<Zenoh id>`: `@mjplug/**` finds all servers."""

INTERFACES = "interfaces"
"""Last chunk of the key on which a server answers with its list: `<namespace>/<node_name>/interfaces`."""

QUERY_TIMEOUT = 2.0
"""Timeout of a query [s]; a reply takes about a millisecond, and longer on a slow network."""

ATTEMPTS = 2
"""Number of queries to a network or a server before it is reported as not answering."""

RETRY = 0.1
"""Pause between two attempts [s]."""

AT_ONCE = zenoh.ConsolidationMode.NONE
"""Delivers each reply to a query as soon as it arrives.

By default, Zenoh delivers the replies only when all programs with a queryable for the key have replied, or after the
timeout, so one program that never replies would delay all replies.
"""

TIMEOUT_TEXT = "Timeout"
"""The error reply with which Zenoh ends a query after its timeout."""


class NoAnswerError(Exception):
    """A network or a server did not answer in time."""


def interfaces_key(name: str) -> str:
    """Returns the key on which a server answers with its list of interfaces.

    Args:
        name: The server's full name.
    """
    return f"{key(name)}/{INTERFACES}"


def server_names(session: zenoh.Session, timeout: float | None = None) -> tuple[str, ...]:
    """Returns the full names of all servers on the network, in alphabetical order.

    Args:
        session: A session on the network.
        timeout: Timeout of each query [s]; by default `QUERY_TIMEOUT`.

    Raises:
        NoAnswerError: The router did not answer any of the queries, so there may be servers.
    """
    timeout = QUERY_TIMEOUT if timeout is None else timeout
    for attempt in range(ATTEMPTS):
        if attempt:
            time.sleep(RETRY)
        names, complete = _announced(session, timeout)
        if names or complete:
            return tuple(sorted(names))
    raise NoAnswerError(f"Zenoh did not answer within {ATTEMPTS * timeout:g} s")


def _announced(session: zenoh.Session, timeout: float) -> tuple[set[str], bool]:
    """Returns the names of the announced servers, and whether the reply was complete."""
    names, complete = set(), True
    for reply in session.liveliness().get(f"{TOKENS}/**", timeout=timeout):
        if reply.ok is None:
            # The only error that Zenoh itself reports for tokens is a timeout.
            complete = False
            continue
        # @mjplug/<namespace>/<node name>/<Zenoh id>
        name = "/" + "/".join(str(reply.ok.key_expr).split("/")[1:-1])
        try:
            validate_name(name)
        except NameRuleError:
            # No server can have this name; any program can declare such a token.
            continue
        names.add(name)
    return names, complete


def lists(session: zenoh.Session, timeout: float) -> Iterator[tuple[str, bytes]]:
    """Yields the names of announced servers and their lists of interfaces, as JSON text, as they arrive.

    Args:
        session: A session on the network.
        timeout: Timeout of each query [s].

    Raises:
        NoAnswerError: The router did not answer.
    """
    missing = set(server_names(session, timeout))
    if not missing:
        return
    for reply in session.get(f"**/{INTERFACES}", target=zenoh.QueryTarget.ALL, consolidation=AT_ONCE, timeout=timeout):
        if reply.ok is None:
            # Services of ROS 2 nodes also match the wildcard, and refuse the query.
            continue
        name = "/" + str(reply.ok.key_expr).removesuffix(f"/{INTERFACES}")
        if name in missing:
            missing.remove(name)
            yield name, reply.ok.payload.to_bytes()
        if not missing:
            # A program that is not a server may also match the key, and never reply.
            return
