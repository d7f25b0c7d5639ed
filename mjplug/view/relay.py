"""The relay: serves the page and connects each browser to the servers of a Zenoh network."""

import asyncio
import contextlib
import json
import logging
from collections.abc import AsyncIterator, Collection
from dataclasses import dataclass
from importlib.metadata import version

import zenoh
from websockets.asyncio.server import ServerConnection, serve
from websockets.http11 import Request, Response

from mjplug.client.errors import ClientError
from mjplug.view.access import Access
from mjplug.view.built_page import BuiltPage
from mjplug.view.connections import ConnectionLimits, limited
from mjplug.view.handoff import Handoff
from mjplug.view.images import Encoder
from mjplug.view.listening import Listening
from mjplug.view.network import Network
from mjplug.view.viewer import Viewer
from mjplug.view.web import Web

_log = logging.getLogger(__name__)

MAX_VIEWERS = 32
"""Maximum number of browsers."""

MAX_MESSAGE = 1 << 20
"""Maximum size of a message from a page [bytes]."""

_RESPONSE_TIMEOUT = 600.0
"""Time for a client to take an HTTP response, such as a large drawing pack over a slow link [s]."""

_LARGE = 1 << 20
"""Size from which a response is large [bytes]."""

_MAX_LARGE = 8
"""Maximum number of large responses on their way; others wait."""

_PING_INTERVAL = 20.0
"""Interval of pings, and timeout of their answers [s]; after that, a connection whose other end is gone is closed."""

_TRY_AGAIN = 1013
"""Close code of WebSockets: too many connections."""


@dataclass(frozen=True, slots=True)
class Options:
    """What the user can choose.

    Attributes:
        nodes: Full names of the servers to show; empty means all.
        read_only: Whether pages may only look.
        origins: Further origins from which a reverse proxy serves the page.
        token: The token that each request needs; None if none is needed.
        frame_ancestors: Origins that may embed the page, as in the header Content-Security-Policy.
    """

    nodes: Collection[str] = ()
    read_only: bool = False
    origins: Collection[str] = ()
    token: str | None = None
    frame_ancestors: str = "'none'"


class Relay:
    """Serves browsers. Event loop only.

    Attributes:
        viewers: The pages.
        limits: The limits of TCP connections, and their number.

    Args:
        options: What the user chose.
        page: The files of the page.
    """

    def __init__(self, options: Options, page: BuiltPage) -> None:
        self._options = options
        self._page = page
        self._network: Network | None = None
        self.viewers: set[Viewer] = set()
        self.limits = ConnectionLimits()
        self._encoder = Encoder()
        self._large = asyncio.Semaphore(_MAX_LARGE)
        self._version = version("mjplug")

    @property
    def network(self) -> Network | None:
        """The network; None before `connect`."""
        return self._network

    def connect(self, session: zenoh.Session) -> None:
        """Shows the servers of a network to all pages.

        Args:
            session: An open session, which the caller closes after this relay.
        """
        handoff = Handoff(asyncio.get_running_loop())
        self._network = Network(session, handoff, self._options.nodes, self._servers_changed)
        for viewer in self.viewers:
            viewer.connect(self._network)

    @contextlib.asynccontextmanager
    async def serving(self, listening: Listening) -> AsyncIterator[None]:
        """Serves browsers inside the block, on sockets that are closed at its end."""
        options = self._options
        access = Access(listening.host, listening.port, options.token, options.origins)
        web = Web(access, self._page, self._scene, options.frame_ancestors)

        async def process(connection: ServerConnection, request: Request) -> Response | None:
            response = await web.answer(request)
            if response is not None and len(response.body) > _LARGE:
                # Each response is copied into the buffer of its connection.
                await self._large.acquire()
                connection.connection_lost_waiter.add_done_callback(lambda _: self._large.release())
            return response

        # The library logs each connection, and a traceback for each invalid request.
        quiet = logging.getLogger(f"{__name__}.websockets")
        quiet.setLevel(logging.CRITICAL + 1)
        checking = asyncio.create_task(self._check())
        try:
            async with contextlib.AsyncExitStack() as stack:
                for each in listening.sockets:
                    await stack.enter_async_context(
                        serve(
                            self._serve,
                            sock=each,
                            process_request=process,
                            compression=None,
                            server_header=None,
                            # `limited` ends connections that send or read too slowly.
                            open_timeout=None,
                            close_timeout=_RESPONSE_TIMEOUT,
                            ping_interval=_PING_INTERVAL,
                            ping_timeout=_PING_INTERVAL,
                            max_size=MAX_MESSAGE,
                            logger=quiet,
                            create_connection=limited(self.limits),
                        )
                    )
                yield
                for viewer in tuple(self.viewers):
                    viewer.end()
        finally:
            checking.cancel()
            self._encoder.close()
            if self._network is not None:
                self._network.close()

    async def _serve(self, connection: ServerConnection) -> None:
        # The closing handshake is short, unlike responses.
        connection.close_timeout = 1.0
        if len(self.viewers) >= MAX_VIEWERS:
            reason = f"{MAX_VIEWERS} browsers are connected, which is the maximum"
            await connection.send(json.dumps({"op": "error", "error": reason}))
            await connection.close(_TRY_AGAIN, reason)
            return
        viewer = Viewer(connection, self._network, self._options.read_only, self._encoder)
        self.viewers.add(viewer)
        try:
            await viewer.run(self._version)
        except Exception:
            _log.exception("the connection of a page failed")
        finally:
            self.viewers.discard(viewer)

    async def _scene(self, hash: str) -> bytes:
        if self._network is None:
            raise ClientError("no server has been found yet")
        return await self._network.scenes.get(hash)

    async def _check(self) -> None:
        """Lets each page check once a second whether it still needs its subscriptions."""
        while True:
            await asyncio.sleep(1.0)
            now = asyncio.get_running_loop().time()
            for viewer in tuple(self.viewers):
                viewer.check(now)

    def _servers_changed(self) -> None:
        assert self._network is not None
        servers = self._network.servers.describe()
        for viewer in self.viewers:
            viewer.send(op="servers", servers=servers)
