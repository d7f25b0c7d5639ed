"""Runs a relay on a thread of its own, beside a program that uses the same Zenoh session."""

import asyncio
import threading
from concurrent.futures import Future

import zenoh

from mjplug.view.built_page import BuiltPage
from mjplug.view.listening import Listening
from mjplug.view.relay import Options, Relay

_STOP_TIMEOUT = 5.0
"""Time for the relay to end [s]."""


class BackgroundRelay:
    """A relay that runs until it is closed.

    Args:
        session: An open session; close it after this.
        listening: The sockets to listen on.
        options: As for `Relay`.
        page: As for `Relay`.
    """

    def __init__(self, session: zenoh.Session, listening: Listening, options: Options, page: BuiltPage) -> None:
        self._started: Future[Relay] = Future()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stop: asyncio.Event | None = None
        # A daemon, so that a program that does not close it can still exit.
        self._thread = threading.Thread(
            target=lambda: asyncio.run(self._run(session, listening, options, page)), name="mjplug view", daemon=True
        )
        self._thread.start()
        self.relay = self._started.result()

    def close(self) -> None:
        """Ends the relay; a second call does nothing."""
        if self._thread.is_alive() and self._loop is not None and self._stop is not None:
            self._loop.call_soon_threadsafe(self._stop.set)
            self._thread.join(_STOP_TIMEOUT)

    async def _run(self, session: zenoh.Session, listening: Listening, options: Options, page: BuiltPage) -> None:
        try:
            self._loop, self._stop = asyncio.get_running_loop(), asyncio.Event()
            relay = Relay(options, page)
            async with relay.serving(listening):
                relay.connect(session)
                self._started.set_result(relay)
                await self._stop.wait()
        except BaseException as error:
            if self._started.done():
                raise
            self._started.set_exception(error)
