"""Runs the relay of `mjplug view` until it is stopped."""

import asyncio
import contextlib
import os
import signal
import threading
from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path

from mjplug.client import Client
from mjplug.client.connection import Timeouts, open_client
from mjplug.client.errors import NoServerError
from mjplug.view.access import new_token
from mjplug.view.built_page import BuiltPage
from mjplug.view.listening import Listening
from mjplug.view.relay import Options, Relay

_SLOW_TIMEOUT = 5.0
"""Timeout for a server that accepts connections but does not answer [s]."""


class Connecting:
    """Connects to the network on a thread of its own, and waits for a server if there is none.

    Args:
        endpoint: As for `mjplug.client.connect`.
        config: As for `mjplug.client.connect`.
        wait: How long to wait for a server [s].
        waiting: Called with the reason if the first attempt fails, or if a server of `nodes` is missing; on the other
            thread.
        nodes: The full names of the servers that are shown; empty means all.
    """

    def __init__(
        self,
        endpoint: str | None,
        config: str | Path | None,
        wait: float,
        waiting: Callable[[str], None],
        nodes: Collection[str] = (),
    ) -> None:
        self._endpoint = endpoint
        self._config = config
        self._wait = wait
        self._waiting = waiting
        self._nodes = nodes

    def start(self, loop: asyncio.AbstractEventLoop) -> "asyncio.Future[Client]":
        """Returns a future of the client."""
        found: asyncio.Future[Client] = loop.create_future()

        def settle(client: Client | None, error: BaseException | None) -> None:
            if found.cancelled():
                if client is not None:
                    client.close()
            elif client is not None:
                found.set_result(client)
            elif error is not None:
                found.set_exception(error)

        def run() -> None:
            client, problem = None, None
            try:
                client = self._open()
                self._check_nodes(client)
            except BaseException as error:
                problem = error
            with contextlib.suppress(RuntimeError):
                # The loop may have ended.
                loop.call_soon_threadsafe(settle, client, problem)

        # A daemon, because Zenoh's attempts cannot be cancelled.
        threading.Thread(target=run, name="view connects", daemon=True).start()
        return found

    def _check_nodes(self, client: Client) -> None:
        present = client.nodes()
        if missing := sorted(set(self._nodes) - set(present)):
            self._waiting(f"{', '.join(missing)} is not on the network; there are: {', '.join(present) or 'none'}")

    def _open(self) -> Client:
        try:
            return open_client(self._endpoint, "", Timeouts(0.0, _SLOW_TIMEOUT), self._config)
        except NoServerError as error:
            if self._wait <= 0.0:
                raise
            self._waiting(str(error))
        return open_client(self._endpoint, "", Timeouts(self._wait, max(self._wait, _SLOW_TIMEOUT)), self._config)


def serve_view(
    connecting: Connecting,
    listening: Listening,
    options: Options,
    ready: Callable[[str], None],
    page: BuiltPage | None = None,
    until_closed: int | None = None,
) -> int:
    """Serves browsers until SIGINT or SIGTERM.

    Args:
        connecting: Connects to the network.
        listening: The sockets to listen on.
        options: What the user chose; beyond loopback, a token is added.
        ready: Called with the URL when the page is served.
        page: The files of the page.
        until_closed: A file descriptor; the relay also ends when the other end closes it.

    Returns:
        The number of the signal that ended it; 0 if `until_closed` did.

    Raises:
        MjplugError: The page has not been built, or no server has been found in time.
    """
    page = page or BuiltPage()
    page.require()
    if not listening.loopback and options.token is None:
        options = replace(options, token=new_token())
    return asyncio.run(_run(connecting, listening, options, ready, page, until_closed))


async def _run(
    connecting: Connecting,
    listening: Listening,
    options: Options,
    ready: Callable[[str], None],
    page: BuiltPage,
    until_closed: int | None,
) -> int:
    loop = asyncio.get_running_loop()
    stopped: asyncio.Future[int] = loop.create_future()

    def stop(number: int) -> None:
        if not stopped.done():
            stopped.set_result(number)

    def stop_at_end(descriptor: int) -> None:
        if not os.read(descriptor, 4096):
            stop(0)

    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stop, int(number))
    if until_closed is not None:
        loop.add_reader(until_closed, stop_at_end, until_closed)
    relay = Relay(options, page)
    found = connecting.start(loop)
    client: Client | None = None
    try:
        async with relay.serving(listening):
            ready(listening.url(options.token))
            await asyncio.wait((found, stopped), return_when=asyncio.FIRST_COMPLETED)
            if found.done():
                client = found.result()
                relay.connect(client.session)
                await stopped
        return stopped.result()
    finally:
        found.cancel()
        if client is not None:
            client.close()
