"""Asks servers what they offer."""

import time
from itertools import chain
from typing import Any

import zenoh

from mjplug.wire.discovery import announced
from mjplug.wire.discovery.announced import AT_ONCE, INTERFACES, NoAnswerError, interfaces_key, server_names
from mjplug.wire.discovery.format import ServerInfo, UnreadableListError, checked, read

_RETRY = 0.1
"""Pause between two attempts [s]."""

_MOST_ASKED = 200
"""How many servers are asked one by one at most; any program can announce any number of them."""


def ask_all(session: zenoh.Session, timeout: float | None = None) -> tuple[dict[str, ServerInfo], dict[str, str]]:
    """Asks all servers of the network at once what they offer.

    Args:
        session: A session on the network.
        timeout: How long to wait for each answer [s]; by default `announced.QUERY_TIMEOUT`.

    Returns:
        What servers offer, by name, and why others that are announced are missing, by name. A server that has stopped
        meanwhile is in neither.

    Raises:
        NoAnswerError: Nobody tells which servers there are.
    """
    timeout = announced.QUERY_TIMEOUT if timeout is None else timeout
    found: dict[str, ServerInfo] = {}
    failed: dict[str, str] = {}
    there = set(server_names(session, timeout))
    for attempt in range(announced.ATTEMPTS):
        if there <= found.keys():
            break
        if attempt:
            time.sleep(_RETRY)
            there &= set(server_names(session, timeout))
        began = time.monotonic()
        # Again, each by its own key: access control may permit that, but not the wildcard.
        missing = sorted(there - found.keys())[:_MOST_ASKED]
        selectors = [interfaces_key(name) for name in missing] if attempt else [f"**/{INTERFACES}"]
        queries = [
            session.get(s, target=zenoh.QueryTarget.ALL, consolidation=AT_ONCE, timeout=timeout) for s in selectors
        ]
        for reply in chain.from_iterable(queries):
            if reply.ok is None:
                # Services of ROS 2 nodes match the wildcard too, and refuse.
                continue
            name = "/" + str(reply.ok.key_expr).removesuffix(f"/{INTERFACES}")
            if name in there and name not in found:
                try:
                    found[name] = read(name, reply.ok.payload.to_bytes())
                except UnreadableListError as error:
                    failed[name] = str(error)
            if there <= found.keys():
                # A program that is no server may match the key too, and never answer.
                break
        waited = time.monotonic() - began
        for name in there - found.keys():
            failed.setdefault(name, f"server {name} is announced but did not answer within {max(waited, 0.01):.2g} s")
    # Sorted, because a router forwards the query to all programs at once, so replies arrive in any order.
    present = {name: found[name] for name in sorted(found)}
    return present, {name: why for name, why in sorted(failed.items()) if name in there and name not in found}


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
    for reply in session.get(selector, consolidation=AT_ONCE, timeout=announced.QUERY_TIMEOUT):
        if reply.ok is not None:
            return checked(name, reply.ok.payload.to_bytes())
        assert reply.err is not None
        if (why := reply.err.payload.to_string()) != "Timeout":
            raise UnreadableListError(f"server {name} cannot tell what it offers: {why}")
    raise NoAnswerError(f"server {name} does not answer; it may have stopped")
