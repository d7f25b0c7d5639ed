"""Looks after the connection of a server to a router that another process runs."""

import logging
import threading
from collections.abc import Callable

import zenoh

from mjplug.errors import WireError
from mjplug.log_scope import bound

_log = logging.getLogger(__name__)

_PERIOD = 0.5
"""How often to look whether the connection is there [s]."""


class RouterWatch:
    """Says when the router is gone and when it is back. May host a router in its place.

    Zenoh itself connects again, with all topics and services, as soon as something listens there.

    A server that found its port taken by another server depends on the router in that server's process. When that
    process ends, each server that depended on it tries to listen on the port; the operating system lets one of them.
    That one hosts a router from then on, as a second session without topics or services.

    Args:
        session: The session that connects.
        endpoints: Where it connects to.
        host: Opens a router in place of one that is gone, or returns None if the port is taken, or raises a WireError;
            None never does.
    """

    def __init__(
        self, session: zenoh.Session, endpoints: tuple[str, ...], host: Callable[[], zenoh.Session | None] | None
    ) -> None:
        self._info = session.info
        self._where = ", ".join(endpoints)
        self._host = host
        self._hosted: zenoh.Session | None = None
        self._told = False
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=bound(self._run), name="router watch", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stops watching; a hosted router stays until `close`. A second call does nothing."""
        self._stopping.set()
        self._thread.join()

    def close(self) -> None:
        """Closes a hosted router. A second call does nothing."""
        self.stop()
        hosted, self._hosted = self._hosted, None
        if hosted is not None:
            hosted.close()  # type: ignore[no-untyped-call]

    def _run(self) -> None:
        connected, had_router = self._connected(had_router=False), False
        while not self._stopping.wait(_PERIOD):
            had_router = had_router or bool(self._info.routers_zid())
            before, connected = connected, self._connected(had_router)
            if connected and not before:
                self._told = False
                _log.warning("connected to %s again", self._where)
            elif before and not connected:
                _log.warning(
                    "the Zenoh router at %s is gone: nobody reaches this server until a router is there again",
                    self._where,
                )
            if not connected and self._host is not None and self._hosted is None:
                self._take_over(self._host)

    def _connected(self, had_router: bool) -> bool:
        # A peer may stay connected to other peers while its router is gone.
        return bool(self._info.routers_zid() or (not had_router and self._info.peers_zid()))

    def _take_over(self, host: Callable[[], zenoh.Session | None]) -> None:
        try:
            self._hosted = host()
        except WireError as error:
            # The address may come back: it is gone while a network interface is down, for example.
            if not self._told:
                _log.warning("no router is hosted in place of the one that is gone: %s; trying again", error)
            self._told = True
            return
        if self._hosted is not None:
            _log.warning("this server hosts the Zenoh router at %s now", self._where)
