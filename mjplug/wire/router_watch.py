"""Monitors the connection of a server to a router in another process."""

import logging
import threading
from collections.abc import Callable

import zenoh

from mjplug.errors import WireError
from mjplug.log_scope import bound

_log = logging.getLogger(__name__)

_CHECK_PERIOD = 0.5
"""Period of the checks of the connection [s]."""


class RouterWatch:
    """Logs when the router is lost and when it is back. May host a replacement router.

    Zenoh itself reconnects, with all topics and services, as soon as a router listens at the endpoint.

    If a server finds its port in use by another server, it uses the router in that server's process. When that process
    ends, each server that used the router tries to listen on the port; the operating system allows it to one of them.
    From then on that server hosts the router, as a second session without topics or services.

    Args:
        session: The session that connects.
        endpoints: The endpoints that it connects to.
        host: Opens a replacement router; returns None if the port is in use, and raises WireError for other failures.
            If `host` is None, no replacement is opened.
    """

    def __init__(
        self, session: zenoh.Session, endpoints: tuple[str, ...], host: Callable[[], zenoh.Session | None] | None
    ) -> None:
        self._info = session.info
        self._where = ", ".join(endpoints)
        self._host = host
        self._hosted: zenoh.Session | None = None
        self._reported = False
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
        while not self._stopping.wait(_CHECK_PERIOD):
            had_router = had_router or bool(self._info.routers_zid())
            before, connected = connected, self._connected(had_router)
            if connected and not before:
                self._reported = False
                _log.warning("the connection to the Zenoh router at %s is back", self._where)
            elif before and not connected:
                _log.warning(
                    "the connection to the Zenoh router at %s is lost; clients cannot reach this server meanwhile",
                    self._where,
                )
            if not connected and self._host is not None and self._hosted is None:
                self._take_over(self._host)

    def _connected(self, had_router: bool) -> bool:
        # A peer may stay connected to other peers after it has lost its router.
        return bool(self._info.routers_zid() or (not had_router and self._info.peers_zid()))

    def _take_over(self, host: Callable[[], zenoh.Session | None]) -> None:
        try:
            self._hosted = host()
        except WireError as error:
            # Retried, because the address may become available again, for example when a network interface is back.
            if not self._reported:
                _log.warning("cannot host a replacement router: %s; trying again", error)
            self._reported = True
            return
        if self._hosted is not None:
            _log.warning("this server now hosts the Zenoh router at %s", self._where)
