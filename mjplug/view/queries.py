"""Zenoh queries from the event loop."""

import asyncio
from typing import Any

import zenoh
from zenoh.handlers import Callback

from mjplug.client.errors import ClientError, TimedOutError
from mjplug.wire.discovery.announced import AT_ONCE, TIMEOUT_TEXT

_END_MARGIN = 1.0
"""Zenoh's own timeout is later by this time [s], because its error has no useful text."""


class RefusedError(ClientError):
    """The reply to a query is an error; the text is that of the reply."""


class NoReplyError(TimedOutError):
    """The query has ended without a reply, before its timeout: nobody has the key, or access rules drop the query."""


async def ask(
    session: zenoh.Session, selector: str, timeout: float, payload: bytes | None = None, encoding: Any = None
) -> bytes:
    """Sends a query and returns the payload of the first reply.

    Args:
        session: The session.
        selector: The key, with parameters.
        timeout: How long to wait [s].
        payload: Payload of the query.
        encoding: Encoding of the payload.

    Raises:
        RefusedError: The reply is an error.
        NoReplyError: The query has ended without a reply.
        TimedOutError: There is no reply in time.
    """
    loop = asyncio.get_running_loop()
    answer: asyncio.Future[zenoh.Reply | None] = loop.create_future()

    def settle(reply: zenoh.Reply | None) -> None:
        if not answer.done():
            answer.set_result(reply)

    def arrived(reply: zenoh.Reply | None) -> None:
        # The loop may have ended.
        if not loop.is_closed():
            loop.call_soon_threadsafe(settle, reply)

    session.get(
        selector,
        Callback(arrived, drop=lambda: arrived(None), indirect=False),
        payload=payload,
        encoding=encoding,
        consolidation=AT_ONCE,
        timeout=timeout + _END_MARGIN,
    )
    key = selector.partition("?")[0]
    try:
        reply = await asyncio.wait_for(answer, timeout)
    except TimeoutError:
        raise _timed_out(key, timeout) from None
    if reply is None:
        raise NoReplyError(f"{key} did not answer; its server may have stopped, or does not permit this client to ask")
    if reply.ok is None:
        assert reply.err is not None
        # Zenoh's own timeout may come first if the event loop is late.
        if (reason := reply.err.payload.to_string()) == TIMEOUT_TEXT:
            raise _timed_out(key, timeout)
        raise RefusedError(reason)
    return bytes(reply.ok.payload)


def _timed_out(key: str, timeout: float) -> TimedOutError:
    return TimedOutError(f"no answer from {key} within {timeout:g} s")
