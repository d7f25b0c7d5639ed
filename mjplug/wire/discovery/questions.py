"""Queries servers for their topics and services."""

import time
from itertools import chain
from typing import Any

import zenoh

from mjplug.wire.discovery import announced
from mjplug.wire.discovery.announced import (
    AT_ONCE,
    INTERFACES,
    TIMEOUT_TEXT,
    NoAnswerError,
    interfaces_key,
    server_names,
)
from mjplug.wire.discovery.format import ServerInfo, UnreadableListError, checked, read

_MAX_SINGLE_QUERIES = 200
"""Maximum number of servers that are queried one by one; any program can announce any number of them."""


def ask_all(session: zenoh.Session, timeout: float | None = None) -> tuple[dict[str, ServerInfo], dict[str, str]]:
    """Queries all servers of the network at once.

    Args:
        session: A session on the network.
        timeout: Timeout of each query [s]; by default `announced.QUERY_TIMEOUT`.

    Returns:
        The servers by name, and the reasons why other announced servers are missing, by name. A server that has stopped
        meanwhile is in neither.

    Raises:
        NoAnswerError: The router did not answer.
    """
    timeout = announced.QUERY_TIMEOUT if timeout is None else timeout
    found: dict[str, ServerInfo] = {}
    failed: dict[str, str] = {}
    there = set(server_names(session, timeout))
    for attempt in range(announced.ATTEMPTS):
        if there <= found.keys():
            break
        if attempt:
            time.sleep(announced.RETRY)
            there &= set(server_names(session, timeout))
        began = time.monotonic()
        # The second time by their own keys, because access control may permit these but not the wildcard.
        missing = sorted(there - found.keys())[:_MAX_SINGLE_QUERIES]
        selectors = [interfaces_key(name) for name in missing] if attempt else [f"**/{INTERFACES}"]
        queries = [
            session.get(s, target=zenoh.QueryTarget.ALL, consolidation=AT_ONCE, timeout=timeout) for s in selectors
        ]
        for reply in chain.from_iterable(queries):
            if reply.ok is None:
                # Services of ROS 2 nodes also match the wildcard, and refuse the query.
                continue
            name = "/" + str(reply.ok.key_expr).removesuffix(f"/{INTERFACES}")
            if name in there and name not in found:
                try:
                    found[name] = read(name, reply.ok.payload.to_bytes())
                except UnreadableListError as error:
                    failed[name] = str(error)
            if there <= found.keys():
                # A program that is not a server may also match the key, and never reply.
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
        schema: Whether to include the definition and JSON Schema of each type, under `types`.

    Raises:
        NoAnswerError: The server did not answer.
        UnreadableListError: The reply is not a list of interfaces.
    """
    selector = f"{interfaces_key(name)}{'?schema=true' if schema else ''}"
    for reply in session.get(selector, consolidation=AT_ONCE, timeout=announced.QUERY_TIMEOUT):
        if reply.ok is not None:
            return checked(name, reply.ok.payload.to_bytes())
        assert reply.err is not None
        if (why := reply.err.payload.to_string()) != TIMEOUT_TEXT:
            raise UnreadableListError(f"server {name} refused the query for its interfaces: {why}")
    raise NoAnswerError(f"server {name} does not answer; it may have stopped")
