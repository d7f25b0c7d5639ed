"""Builds the Zenoh configuration of a session from the settings and the configuration file, and opens it."""

import json
import logging
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import zenoh

from mjplug.errors import WireError
from mjplug.wire import exposure, identity, linger, queues
from mjplug.wire.endpoints import dialable, has_free_port, on_free_port, with_free_port
from mjplug.wire.handshake import why_worker_is_refused
from mjplug.wire.zenoh_file import read_zenoh_file

Mode = Literal["auto", "router", "peer", "client"]
Role = Literal["router", "peer", "client"]

DEFAULT_LISTEN = "tcp/127.0.0.1:7447"
"""The endpoint at which ROS 2 nodes with rmw_zenoh expect a router."""

_PROBE_TIMEOUT_MS = 1000
"""Timeout of Zenoh's handshake with an unknown program [ms]; on the same machine it takes 3 ms."""

_MAX_PORT_ATTEMPTS = 10
"""Maximum number of attempts to find a free port, because another program may take the port first."""

_IN_USE = re.compile(r"address already in use|only one usage of each socket address", re.IGNORECASE)
_SOURCE_PLACE = re.compile(r" at /\S*?\.rs:\d+\.?")


@dataclass(frozen=True, slots=True)
class SessionSettings:
    """Settings of a Zenoh session.

    Attributes:
        mode: `auto` opens a router on the `listen` endpoints; if a Zenoh router already listens on one of them, it
            opens a client of that router. With `connect` and without `listen`, `auto` opens a client of the router that
            `connect` names. A `mode` in the file overrides `auto`.
        listen: Endpoints to listen on; port 0 means any free port. None uses the file's endpoints; if the file has
            none, `tcp/127.0.0.1:7447` for a router and any free port of 127.0.0.1 for a peer.
        connect: Endpoints to connect to. A client connects to the first one that answers; the other modes retry all of
            them until they answer. Empty uses the file's endpoints.
        config: A Zenoh configuration file (JSON5, JSON or YAML): TLS, credentials, access control and so on.
        worker_config: The configuration file for worker processes; None means `config`.
        access_control: The value of Zenoh's setting `access_control`, instead of the file's; None uses the file's.
    """

    mode: Mode = "auto"
    listen: tuple[str, ...] | None = None
    connect: tuple[str, ...] = ()
    config: Path | None = None
    worker_config: Path | None = None
    access_control: Mapping[str, Any] | None = None


_log = logging.getLogger(__name__)


class UnreachableError(WireError):
    """No endpoint to which the session connects answers."""


class EndpointInUseError(WireError):
    """Another program listens on an endpoint."""

    def __init__(self, endpoint: str) -> None:
        self.endpoint = endpoint
        super().__init__(
            f"{endpoint} is in use by another program; choose another endpoint with --listen, "
            "or use zenoh.mode auto to join the router there"
        )

    def message_with_roles(self) -> str:
        """Returns the message for a server with roles, which must host the router itself to apply its access rules."""
        return (
            f"{self.endpoint} is in use, and a server with roles does not join the router of another program, because "
            f"the access rules there do not contain its topics; choose another endpoint with --listen, such as "
            f"--listen {on_free_port(self.endpoint)}"
        )

    def message_not_zenoh(self) -> str:
        """Returns the message for an endpoint where no Zenoh router accepts the connection."""
        return (
            f"{self.endpoint} is in use by another program that does not speak Zenoh or refuses the connection; "
            f"choose another endpoint with --listen, such as --listen {on_free_port(self.endpoint)}, which is free "
            f"now, or --listen {DEFAULT_LISTEN.rpartition(':')[0]}:0 for any free port"
        )


class Plan:
    """The settings combined with the configuration file.

    Attributes:
        mode: The mode of the settings, or of the file if the settings say `auto`.
        connect: Endpoints to connect to.
        listen_is_set: Whether the settings or the file name endpoints to listen on.

    Args:
        settings: The settings.
        name: The server's full name; empty for a session without a server.
    """

    def __init__(self, settings: SessionSettings, name: str) -> None:
        self._settings = settings
        self._name = name
        file = self._base()
        mode: str | None = json.loads(file.get_json("mode"))
        self.mode: Mode = mode if settings.mode == "auto" and mode else settings.mode  # type: ignore[assignment]
        self.connect = settings.connect or _endpoints(file, "connect", "peer")
        self.listen_is_set = settings.listen is not None or file.get_json("listen") != zenoh.Config().get_json("listen")

    def listen_endpoints(self, role: Role) -> tuple[str, ...]:
        """Returns the endpoints to listen on; port 0 is not yet replaced."""
        if role == "client":
            return ()
        file = self._base()
        endpoints = _endpoints(file, "listen", role) if self.listen_is_set else ()
        default = DEFAULT_LISTEN if role == "router" else "tcp/127.0.0.1:0"
        return (endpoints or (default,)) if self._settings.listen is None else self._settings.listen

    def open(
        self, role: Role, listen: tuple[str, ...], connect: tuple[str, ...]
    ) -> tuple[zenoh.Session, tuple[str, ...]]:
        """Opens the session, unless another server has the name.

        Returns:
            The session, and the endpoints it listens on, with their actual ports.

        Raises:
            EndpointInUseError: Another program listens on one of the endpoints.
            UnreachableError: A client can connect to none of the endpoints.
            WireError: The session cannot be opened for another reason.
        """
        if role == "client" and not connect:
            raise WireError("mode client needs an endpoint to connect to; give one with --connect")
        for endpoint in connect if self._name else ():
            with self.probe(endpoint) as client:
                if client is not None:
                    identity.refuse_duplicate(client, self._name)
        for _ in range(_MAX_PORT_ATTEMPTS):
            listening = tuple(with_free_port(endpoint) for endpoint in listen)
            config = self._with_access(self._config(role, listening, connect))
            try:
                session = self._session(config, listening)
            except zenoh.ZError as error:
                if not _IN_USE.search(str(error)):
                    kind = UnreachableError if role == "client" else WireError
                    raise kind(_open_error(listening, connect, error)) from error
                at = next((i for i, endpoint in enumerate(listening) if endpoint in str(error)), 0)
                if not has_free_port(listen[at]):
                    raise EndpointInUseError(listening[at]) from error
            else:
                return session, listening
        raise WireError(f"found no free port for {', '.join(listen)} in {_MAX_PORT_ATTEMPTS} attempts")

    def host_router(self, listen: tuple[str, ...]) -> zenoh.Session | None:
        """Opens a router; returns None if another program already listens on one of the endpoints.

        Raises:
            WireError: It cannot listen for another reason.
        """
        config = self._config("router", listen, ())
        try:
            return self._session(config, listen)
        except zenoh.ZError as error:
            if _IN_USE.search(str(error)):
                return None
            raise WireError(_open_error(listen, (), error)) from error

    def join(self, connect: tuple[str, ...]) -> zenoh.Session:
        """Opens a client session.

        Raises:
            WireError: No endpoint accepts the connection.
        """
        config = self._config("client", (), connect, queues.WORKER_DROP_WAIT_US)
        # The server applies the access rules on its side of this link.
        _set(config, "access_control/enabled", False)
        try:
            return self._session(config)
        except zenoh.ZError as error:
            hint = why_worker_is_refused(config, self._settings.config, connect)
            raise WireError(f"{_open_error((), connect, error)}{hint}") from error

    @contextmanager
    def probe(self, endpoint: str) -> Iterator[zenoh.Session | None]:
        """Opens a short-lived client session; yields None if no Zenoh session answers."""
        config = self._config("client", (), (dialable(endpoint),))
        _set(config, "transport/unicast/open_timeout", _PROBE_TIMEOUT_MS)
        _set(config, "connect/timeout_ms", _PROBE_TIMEOUT_MS)
        try:
            session = zenoh.open(config)
        except zenoh.ZError:
            yield None
            return
        with session:
            yield session

    def _session(self, config: zenoh.Config, listening: tuple[str, ...] = ()) -> zenoh.Session:
        session = zenoh.open(config)
        linger.watch(session)
        for warning in exposure.warnings(listening, config):
            _log.warning("%s", warning)
        return session

    def _config(
        self, role: Role, listening: tuple[str, ...], connect: tuple[str, ...], drop_wait: int = queues.DROP_WAIT_US
    ) -> zenoh.Config:
        config = self._base()
        _set(config, "mode", role)
        try:
            _set(config, "listen/endpoints", listening)
            _set(config, "connect/endpoints", connect)
        except zenoh.ZError as error:
            raise WireError(_open_error(listening, connect, error)) from error
        _set_default(config, "scouting/multicast/enabled", False)
        _set_default(config, "timestamping/enabled", True)
        if role == "router" and not connect:
            # A router waits for this delay even if it has no peers to discover.
            _set_default(config, "scouting/delay", 0)
        queues.tune(config, drop_wait)
        return config

    def _with_access(self, config: zenoh.Config) -> zenoh.Config:
        if self._settings.access_control is not None:
            _set(config, "access_control", self._settings.access_control)
        return config

    def _base(self) -> zenoh.Config:
        path = self._settings.config
        try:
            return read_zenoh_file(path)
        except zenoh.ZError as error:
            raise WireError(f"cannot use the Zenoh configuration file {path}: {_message_of(error)}") from error


def _endpoints(config: zenoh.Config, key: Literal["listen", "connect"], role: Role) -> tuple[str, ...]:
    """Returns the endpoints of a configuration, which may differ per role."""
    endpoints = json.loads(config.get_json(f"{key}/endpoints"))
    return tuple(endpoints.get(role, ()) if isinstance(endpoints, dict) else endpoints or ())


def _set(config: zenoh.Config, key: str, value: Any) -> None:
    config.insert_json5(key, json.dumps(value))


def _set_default(config: zenoh.Config, key: str, value: Any) -> None:
    if json.loads(config.get_json(key)) is None:
        _set(config, key, value)


def _open_error(listening: tuple[str, ...], connect: tuple[str, ...], error: zenoh.ZError) -> str:
    actions = [
        f"{verb} {', '.join(ends)}" for verb, ends in (("listen on", listening), ("connect to", connect)) if ends
    ]
    return f"cannot {' and '.join(actions) or 'open a Zenoh session'}: {_message_of(error)}"


def _message_of(error: zenoh.ZError) -> str:
    """Returns the message of a Zenoh error without the places in Zenoh's source code."""
    return _SOURCE_PLACE.sub("", str(error)).strip()
