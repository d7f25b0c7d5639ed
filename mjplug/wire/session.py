"""Opens the Zenoh session of a server.

A network is a Zenoh router and the sessions connected to it. The session of a server is the router of a new network,
or it connects to the router of an existing one.
"""

import logging
import threading
import time
from dataclasses import replace

import zenoh

from mjplug.errors import WireError
from mjplug.wire.endpoints import dialable, on_free_port
from mjplug.wire.handshake import ENCRYPTED
from mjplug.wire.router_watch import RouterWatch
from mjplug.wire.session_plan import EndpointInUseError, Mode, Plan, Role, SessionSettings, UnreachableError

__all__ = ["Mode", "Role", "SessionSettings", "WireSession", "join", "open_router", "open_session"]

_log = logging.getLogger(__name__)

_RETRY_INTERVAL = 1.0
"""Interval between two attempts to connect to a router [s]."""

CLOSE_TIMEOUT = 1.0
"""How long to wait until the session is closed [s].

Zenoh waits 2.5 s for each client that does not read, for about two at a time: 5 s for four clients.
"""


class WireSession:
    """An open Zenoh session and its endpoints.

    Attributes:
        zenoh: The session.
        role: Zenoh's mode of the session: `router`, `peer` or `client`.
        listening: The endpoints it listens on, with their actual ports.
        joined: The endpoints it connects to.

    Args:
        session: The session.
        role: Zenoh's mode of the session.
        listening: The endpoints it listens on, with their actual ports.
        joined: The endpoints it connects to.
        watch: Monitors the connection to `joined`, and may host a replacement router; it is closed with the session.
    """

    def __init__(
        self,
        session: zenoh.Session,
        role: Role,
        listening: tuple[str, ...],
        joined: tuple[str, ...],
        watch: RouterWatch | None = None,
    ) -> None:
        self.zenoh = session
        self.role = role
        self.listening = listening
        self.joined = joined
        self._watch = watch

    @property
    def endpoint(self) -> str:
        """The endpoint to which clients connect."""
        return self.endpoints[0]

    @property
    def endpoints(self) -> tuple[str, ...]:
        """All endpoints of this network to which clients can connect, preferred first."""
        return self.listening if self.role == "router" else self.joined or self.listening

    def close(self) -> None:
        """Closes the session; a second call does nothing.

        If clients do not read, it returns after `CLOSE_TIMEOUT`, and the session is closed later, or by the end of the
        process.
        """
        if self._watch is not None:
            self._watch.stop()
        if not self.zenoh.is_closed():
            self._close_zenoh()
        if self._watch is not None:
            # After the session, because the session may be connected to a router that the watch hosts.
            self._watch.close()

    def _close_zenoh(self) -> None:
        errors: list[zenoh.ZError] = []

        def close() -> None:
            try:
                # zenoh's stubs leave the return type open.
                self.zenoh.close()  # type: ignore[no-untyped-call]
            except zenoh.ZError as error:
                errors.append(error)

        closing = threading.Thread(target=close, name="close session", daemon=True)
        closing.start()
        closing.join(CLOSE_TIMEOUT)
        if closing.is_alive():
            _log.info("a client does not read; the session is not closed yet after %g s", CLOSE_TIMEOUT)
        elif errors:
            raise errors[0]


def open_session(settings: SessionSettings, name: str, timeout: float | None = None) -> WireSession:
    """Opens the session of a server.

    With the mode `auto`:
    - If only endpoints to connect to are set, it is a client of the router there, and waits until the router answers.
    - Otherwise it is a router, and listens.
    - If another Zenoh router already listens on the endpoint, it is a client of that router. When that router ends, one
      of these clients opens a new router on the endpoint. If endpoints to connect to are set too, it is a peer instead.

    Args:
        settings: The session's settings.
        name: The server's full name, such as `/robot1/mjplug`.
        timeout: How long to wait for a router that does not answer [s]; None for no limit.

    Raises:
        WireError: It cannot listen on or connect to an endpoint, or another server of this name is on the network. The
            message says what to do.
    """
    plan = Plan(settings, name)
    if plan.mode != "auto":
        return _open(plan, plan.mode, plan.listen_endpoints(plan.mode), plan.connect)
    if plan.connect and not plan.listen_is_set:
        return _wait_for_router(plan, timeout)
    listen = plan.listen_endpoints("router")
    try:
        return _open(plan, "router", listen, plan.connect)
    except EndpointInUseError as error:
        if settings.access_control is not None:
            # Only the router applies access rules, and the other router does not have those of this server.
            raise WireError(error.message_with_roles()) from None
        with plan.probe(error.endpoint) as client:
            if client is None:
                raise WireError(error.message_not_zenoh()) from None
        router = dialable(error.endpoint)
        if plan.connect:
            # A client has only one connection, but this session needs several: to the router here and to `connect`.
            return _open(plan, "peer", tuple(on_free_port(endpoint) for endpoint in listen), (router, *plan.connect))
        return _open(plan, "client", (), (router,), takes_over=listen)


def open_router(settings: SessionSettings) -> WireSession:
    """Opens a router without a server.

    Raises:
        WireError: It cannot listen on an endpoint. The message says what to do.
    """
    plan = Plan(settings, "")
    try:
        return _open(plan, "router", plan.listen_endpoints("router"), plan.connect)
    except EndpointInUseError as error:
        with plan.probe(error.endpoint) as client:
            if client is None:
                raise WireError(error.message_not_zenoh()) from None
        raise WireError(
            f"a Zenoh router or server already listens on {error.endpoint}; use that one, stop it, or choose another "
            "endpoint with --listen"
        ) from None


def join(settings: SessionSettings, endpoints: tuple[str, ...]) -> zenoh.Session:
    """Opens the client session of a worker process, on the network of its server.

    It uses `worker_config`, or, if there is none, the configuration file of the server.

    Args:
        settings: The server's settings.
        endpoints: Endpoints to connect to; the first one that answers is used.

    Raises:
        WireError: No endpoint accepts the connection.
    """
    connect = tuple(dialable(endpoint) for endpoint in endpoints)
    if settings.worker_config is not None:
        # The certificate in `worker_config` identifies the process, and only encrypted endpoints use certificates.
        encrypted = tuple(endpoint for endpoint in connect if endpoint.startswith(ENCRYPTED))
        connect = encrypted or connect
        settings = replace(settings, config=settings.worker_config)
    return Plan(settings, "").join(connect)


def _open(
    plan: Plan, role: Role, listen: tuple[str, ...], connect: tuple[str, ...], takes_over: tuple[str, ...] = ()
) -> WireSession:
    """Opens a session and monitors its connections.

    When the connection to the router is lost, a replacement router is opened on the endpoints `takes_over`, if any.
    """
    session, listening = plan.open(role, listen, connect)
    watch = None
    if connect:
        watch = RouterWatch(session, connect, (lambda: plan.host_router(takes_over)) if takes_over else None)
    return WireSession(session, role, listening, connect, watch)


def _wait_for_router(plan: Plan, timeout: float | None) -> WireSession:
    """Opens a client session to the router at `plan.connect`; retries until the router answers."""
    reported = False
    end = None if timeout is None else time.monotonic() + timeout
    while True:
        try:
            return _open(plan, "client", (), plan.connect)
        except UnreachableError as error:
            if end is not None and time.monotonic() >= end:
                raise WireError(f"{error}; waited {timeout:g} s for it") from error
            if not reported:
                _log.warning("%s; waiting for it", error)
                reported = True
        time.sleep(_RETRY_INTERVAL)
