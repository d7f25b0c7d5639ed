"""Frames, overlays and descriptions of the servers that pages watch."""

import asyncio
import json
import logging
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import zenoh

from mjplug.client.errors import ClientError
from mjplug.view.feeds import Feeds
from mjplug.view.queries import RefusedError, ask
from mjplug.view.remote_server import Server
from mjplug.view.scenes import Scenes

_log = logging.getLogger(__name__)

OVERLAYS = (
    "contacts",
    "contact_forces",
    "tendons",
    "joints",
    "actuators",
    "com",
    "inertia",
    "rangefinders",
    "frames",
    "perturbation",
)
"""The kinds of overlays, in the order of docs/wire.md; the index is the channel."""

_TIMEOUT = 60.0
"""Timeout of the query for the description [s]; the server answers when it has made the drawing pack."""

_RETRY = 0.5
"""Pause before the description is queried again [s]."""

_SLOW_RETRY = 2.0
"""The same pause after a problem has been reported [s]."""

_QUIET = 10.0
"""Time without an answer after which pages are told [s]; a server that is starting is announced before it answers."""


class Watcher(Protocol):
    """A page that watches a server."""

    def described(self, server: Server, info: str) -> None:
        """Takes the description of a server, as JSON text."""

    def failed(self, reason: str) -> None:
        """Takes the reason why a server cannot be shown."""


class Watched:
    """The description of one server, which is subscribed to while a page watches.

    Attributes:
        server: The server.
        info: The description; None until it has arrived, and after the server has left.

    Args:
        server: The server.
        session: The session.
        feeds: The feeds of the network.
        scenes: Gets the hash of the drawing pack.
    """

    def __init__(self, server: Server, session: zenoh.Session, feeds: Feeds, scenes: Scenes) -> None:
        self.server = server
        self.info: dict[str, Any] | None = None
        self._text = ""
        # Why pages do not get the description; empty if they do, or if it may only take a while.
        self._problem = ""
        self._session = session
        self._feeds = feeds
        self._scenes = scenes
        self._watchers: list[Watcher] = []
        self._query: asyncio.Task[None] | None = None

    @property
    def wants_all(self) -> bool:
        """Only the newest description counts."""
        return False

    def add(self, watcher: Watcher) -> None:
        """Reports the description to a watcher, now and after each change."""
        self._watchers.append(watcher)
        if len(self._watchers) == 1:
            self._feeds.add(f"{self.server.key}/@view/info", self)
            self._ask()
        elif self.info is not None:
            watcher.described(self.server, self._text)
        elif self._problem:
            watcher.failed(self._problem)

    def remove(self, watcher: Watcher) -> None:
        """Ends what `add` began."""
        self._watchers.remove(watcher)
        if not self._watchers:
            self._feeds.remove(f"{self.server.key}/@view/info", self)
            self._reset()

    def server_changed(self) -> None:
        """Asks again, because the server has left, or has been replaced by another one."""
        self._reset()
        if self._watchers:
            self._ask()

    def receive(self, payloads: Sequence[bytes], lost: int) -> None:
        """Takes the description that the server publishes after a change."""
        self._take(payloads[-1])

    def close(self) -> None:
        """Cancels the query."""
        self._reset()

    def _reset(self) -> None:
        self.info, self._problem = None, ""
        if self._query is not None:
            self._query.cancel()
            self._query = None

    def _ask(self) -> None:
        if self.server.connected:
            self._query = asyncio.create_task(self._run())

    async def _run(self) -> None:
        clock = asyncio.get_running_loop().time
        began = clock()
        while self.info is None:
            try:
                answer = await ask(self._session, f"{self.server.key}/@view/info", _TIMEOUT)
                # One that was published meanwhile is newer.
                if self.info is None:
                    self._take(answer)
            except RefusedError as error:
                self._report(f"{self.server.name} cannot be shown: {error}")
            except ClientError as error:
                if clock() - began >= _QUIET:
                    self._report(f"{self.server.name} is not shown yet; the view asks again: {error}")
            if self.info is None:
                await asyncio.sleep(_SLOW_RETRY if self._problem else _RETRY)

    def _report(self, problem: str) -> None:
        if problem == self._problem or self.info is not None:
            return
        self._problem = problem
        for watcher in tuple(self._watchers):
            watcher.failed(problem)

    def _take(self, payload: bytes) -> None:
        try:
            info = json.loads(payload)
            hash = info["scene"]
            if not isinstance(hash, str):
                raise TypeError(f"the hash is {hash!r}")
            # Encoded again, because the text becomes a part of the message to the page.
            text = json.dumps(info, separators=(",", ":"), allow_nan=False)
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            _log.warning("%s sent a description that cannot be read: %r", self.server.name, error)
            return
        self.info, self._text, self._problem = info, text, ""
        self._scenes.announce(hash, self.server.key)
        for watcher in tuple(self._watchers):
            watcher.described(self.server, text)


class Stream:
    """Passes frames or overlays of one server to one page, once the page has the description.

    Args:
        watched: The server.
        deliver: Called with the newest payload.
    """

    def __init__(self, watched: Watched, deliver: Callable[[bytes], None]) -> None:
        self._watched = watched
        self._deliver = deliver

    @property
    def wants_all(self) -> bool:
        """Only the newest frame is shown."""
        return False

    def receive(self, payloads: Sequence[bytes], lost: int) -> None:
        """Passes the newest payload on."""
        # Without a description, it may be a frame of another model than the page draws.
        if self._watched.info is not None:
            self._deliver(payloads[-1])
