"""The Zenoh session: how the server gets onto a network, or makes one."""

import logging
import time
from dataclasses import replace

import zenoh

from mjplug.errors import WireError
from mjplug.wire.endpoints import dialable, on_free_port
from mjplug.wire.handshake import ENCRYPTED
from mjplug.wire.router_watch import RouterWatch
from mjplug.wire.session_plan import Mode, Plan, Role, SessionSettings, TakenError, UnreachableError

__all__ = ["Mode", "Role", "SessionSettings", "WireSession", "join", "open_router", "open_session"]

_log = logging.getLogger(__name__)

_RETRY = 1.0
"""Pause between two attempts to reach the router that `connect` names [s]."""


class WireSession:
    """An open Zenoh session, and how it is reached.

    Attributes:
        zenoh: The session.
        role: What this session is on the network.
        listening: The endpoints it listens on, with their actual ports.
        joined: The endpoints it connects to.

    Args:
        session: As above.
        role: As above.
        listening: As above.
        joined: As above.
        watch: What looks after the connection to `joined`; closed with the session.
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
        """The endpoint to tell users: where a client that wants to talk to this server connects."""
        return self.endpoints[0]

    @property
    def endpoints(self) -> tuple[str, ...]:
        """All endpoints at which this network can be joined, the first choice first."""
        return self.listening if self.role == "router" else self.joined or self.listening

    def close(self) -> None:
        """Leaves the network; a second call does nothing."""
        if self._watch is not None:
            self._watch.stop()
        if not self.zenoh.is_closed():
            # zenoh's stubs leave the return type open.
            self.zenoh.close()  # type: ignore[no-untyped-call]
        if self._watch is not None:
            # After the session, which may be connected to the router that the watch hosts.
            self._watch.close()


def open_session(settings: SessionSettings, name: str) -> WireSession:
    """Opens the session of the server called `name`, such as `/robot1/mjplug`.

    Raises:
        WireError: Nobody can listen or connect there, or a server of this name is on the network. The sentence says
            the way out.
    """
    plan = Plan(settings, name)
    if plan.mode != "auto":
        return _open(plan, plan.mode, plan.listen(plan.mode), plan.connect)
    if plan.connect and not plan.listens:
        return _open_client(plan)
    listen = plan.listen("router")
    try:
        return _open(plan, "router", listen, plan.connect)
    except TakenError as taken:
        if settings.access_control is not None:
            raise WireError(taken.with_roles()) from None
        with plan.visit(taken.endpoint) as visitor:
            if visitor is None:
                raise WireError(taken.way_out()) from None
        router = dialable(taken.endpoint)
        if plan.connect:
            # A client has one connection only.
            return _open(plan, "peer", tuple(on_free_port(endpoint) for endpoint in listen), (router, *plan.connect))
        return _open(plan, "client", (), (router,), inherits=listen)


def open_router(settings: SessionSettings) -> WireSession:
    """Opens a router without a server.

    Raises:
        WireError: It cannot listen there. The sentence says the way out.
    """
    plan = Plan(settings, "")
    try:
        return _open(plan, "router", plan.listen("router"), plan.connect)
    except TakenError as taken:
        with plan.visit(taken.endpoint) as visitor:
            if visitor is None:
                raise WireError(taken.way_out()) from None
        raise WireError(
            f"a Zenoh router or server listens on {taken.endpoint} already; use that one, stop it, or choose another "
            "endpoint with --listen"
        ) from None


def join(settings: SessionSettings, endpoints: tuple[str, ...]) -> zenoh.Session:
    """Opens a client's session on the network of a server of this machine, with the server's own configuration file.

    Args:
        settings: The server's settings.
        endpoints: Where to connect to; the first that answers is taken.

    Raises:
        WireError: None of them lets us in.
    """
    connect = tuple(dialable(endpoint) for endpoint in endpoints)
    if settings.worker_config is not None:
        # Only over these can a worker show its certificate.
        connect = tuple(endpoint for endpoint in connect if endpoint.startswith(ENCRYPTED)) or connect
        settings = replace(settings, config=settings.worker_config)
    return Plan(settings, "").join(connect)


def _open(
    plan: Plan, role: Role, listen: tuple[str, ...], connect: tuple[str, ...], inherits: tuple[str, ...] = ()
) -> WireSession:
    """Opens a session and watches its connections; `inherits` is where to host a router when the present one ends."""
    session, listening = plan.open(role, listen, connect)
    watch = None
    if connect:
        watch = RouterWatch(session, connect, (lambda: plan.host(inherits)) if inherits else None)
    return WireSession(session, role, listening, connect, watch)


def _open_client(plan: Plan) -> WireSession:
    """Connects to the router that `connect` names, as soon as it is there."""
    reported = False
    while True:
        try:
            return _open(plan, "client", (), plan.connect)
        except UnreachableError as error:
            if not reported:
                _log.warning("%s; waiting for it", error)
                reported = True
        time.sleep(_RETRY)
