"""Asks a network which servers it has, and servers what they offer.

Imports little, because the TAB key of a shell waits for it.
"""

import time
from itertools import chain
from typing import Any

import zenoh

from mjplug.errors import MjplugError
from mjplug.wire.discovery.format import (
    INTERFACES,
    TOKENS,
    ServerInfo,
    UnreadableListError,
    checked,
    interfaces_key,
    read,
)
from mjplug_schemas.errors import NameRuleError
from mjplug_schemas.names import validate_name

QUERY_TIMEOUT = 2.0
"""How long to wait for an answer [s]; it takes a millisecond, and a slow network somewhat longer."""

_ATTEMPTS = 2
"""How often a network or a server is asked before it is reported as not answering."""

_RETRY = 0.1
"""Pause between two attempts [s]."""

_MOST_ASKED = 200
"""How many servers are asked one by one at most; any program can announce any number of them."""

AT_ONCE = zenoh.ConsolidationMode.NONE
"""Hands over each reply to a query when it comes.

By default, Zenoh keeps replies back until every program with a queryable that matches the key has answered, or until
the timeout: one program that never answers would make everybody wait.
"""


class NoAnswerError(MjplugError):
    """A network or a server that did not answer in time."""


def server_names(session: zenoh.Session, timeout: float | None = None) -> tuple[str, ...]:
    """Returns the full names of all servers on the network, in alphabetical order.

    Args:
        session: A session on the network.
        timeout: How long to wait for each answer [s]; by default `QUERY_TIMEOUT`.

    Raises:
        NoAnswerError: The router did not answer, even when it was asked again; so there may be servers.
    """
    timeout = QUERY_TIMEOUT if timeout is None else timeout
    for attempt in range(_ATTEMPTS):
        if attempt:
            time.sleep(_RETRY)
        names, complete = _announced(session, timeout)
        if names or complete:
            return tuple(sorted(names))
    raise NoAnswerError(f"Zenoh did not answer within {_ATTEMPTS * timeout:g} s")


def _announced(session: zenoh.Session, timeout: float) -> tuple[set[str], bool]:
    """Returns the names of the servers that are announced, and whether the answer was complete."""
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


def ask_all(session: zenoh.Session, timeout: float | None = None) -> tuple[dict[str, ServerInfo], dict[str, str]]:
    """Asks all servers of the network at once what they offer.

    Args:
        session: A session on the network.
        timeout: How long to wait for each answer [s]; by default `QUERY_TIMEOUT`.

    Returns:
        What servers offer, by name, and why others that are announced are missing, by name. A server that has stopped
        meanwhile is in neither.

    Raises:
        NoAnswerError: Nobody tells which servers there are.
    """
    timeout = QUERY_TIMEOUT if timeout is None else timeout
    found: dict[str, ServerInfo] = {}
    failed: dict[str, str] = {}
    announced = set(server_names(session, timeout))
    for attempt in range(_ATTEMPTS):
        if announced <= found.keys():
            break
        if attempt:
            time.sleep(_RETRY)
            announced &= set(server_names(session, timeout))
        began = time.monotonic()
        # Again, each by its own key: access control may permit that, but not the wildcard.
        missing = sorted(announced - found.keys())[:_MOST_ASKED]
        selectors = [interfaces_key(name) for name in missing] if attempt else [f"**/{INTERFACES}"]
        queries = [
            session.get(s, target=zenoh.QueryTarget.ALL, consolidation=AT_ONCE, timeout=timeout) for s in selectors
        ]
        for reply in chain.from_iterable(queries):
            if reply.ok is None:
                # Services of ROS 2 nodes match the wildcard too, and refuse.
                continue
            name = "/" + str(reply.ok.key_expr).removesuffix(f"/{INTERFACES}")
            if name in announced and name not in found:
                try:
                    found[name] = read(name, reply.ok.payload.to_bytes())
                except UnreadableListError as error:
                    failed[name] = str(error)
            if announced <= found.keys():
                # A program that is no server may match the key too, and never answer.
                break
        waited = time.monotonic() - began
        for name in announced - found.keys():
            failed.setdefault(name, f"server {name} is announced but did not answer within {max(waited, 0.01):.2g} s")
    # A router asks everybody whom it knows at once.
    present = {name: found[name] for name in sorted(found)}
    return present, {name: why for name, why in sorted(failed.items()) if name in announced and name not in found}


def ask(session: zenoh.Session, name: str, schema: bool = False) -> dict[str, Any]:
    """Returns the list of interfaces of one server, as it sends it.

    Args:
        session: A session on its network.
        name: The server's full name.
        schema: Whether the definition and JSON Schema of each type should be there, under `types`.

    Raises:
        NoAnswerError: It does not answer.
        UnreadableListError: What it answers is no list of interfaces.
    """
    selector = f"{interfaces_key(name)}{'?schema=true' if schema else ''}"
    for reply in session.get(selector, consolidation=AT_ONCE, timeout=QUERY_TIMEOUT):
        if reply.ok is not None:
            return checked(name, reply.ok.payload.to_bytes())
        assert reply.err is not None
        if (why := reply.err.payload.to_string()) != "Timeout":
            raise UnreadableListError(f"server {name} cannot tell what it offers: {why}")
    raise NoAnswerError(f"server {name} does not answer; it may just have stopped")
