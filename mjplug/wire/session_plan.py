"""What a Zenoh session of the server is opened with: the settings laid over the configuration file."""

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
"""Where ROS 2 nodes on rmw_zenoh look for a router."""

_PROBE_MS = 1000
"""How long to wait for an answer to Zenoh's handshake [ms]; on the same machine it takes 3 ms."""

_RACES = 10
"""How often to pick another free port when somebody else took it first."""

_IN_USE = re.compile(r"address already in use|only one usage of each socket address", re.IGNORECASE)
_SOURCE_PLACE = re.compile(r" at /\S*?\.rs:\d+\.?")


@dataclass(frozen=True, slots=True)
class SessionSettings:
    """How to get onto the network.

    Attributes:
        mode: `auto` is a router on the `listen` endpoints; where Zenoh already listens on one of them, a client of the
            router there. With `connect` and without `listen`, it is a client of the router that `connect` names. A
            `mode` in the file takes the place of `auto`.
        listen: Endpoints to listen on; port 0 is any free one. None leaves it to the file, and then to the mode's
            default: `tcp/127.0.0.1:7447` for a router, any free port of 127.0.0.1 for a peer.
        connect: Endpoints to connect to, retried for ever, except with mode `client`; a client connects to the first
            that answers. Empty leaves it to the file.
        config: A Zenoh configuration file (JSON5, JSON or YAML): TLS, credentials, access control and so on.
        worker_config: The one that worker processes use; None is `config`.
        access_control: The value of Zenoh's setting of that name, in place of the file's; None leaves it to the file.
    """

    mode: Mode = "auto"
    listen: tuple[str, ...] | None = None
    connect: tuple[str, ...] = ()
    config: Path | None = None
    worker_config: Path | None = None
    access_control: Mapping[str, Any] | None = None


_log = logging.getLogger(__name__)


class UnreachableError(WireError):
    """Nothing answers where the session shall connect to."""


class TakenError(WireError):
    """Another program listens on an endpoint."""

    def __init__(self, endpoint: str) -> None:
        self.endpoint = endpoint
        super().__init__(
            f"{endpoint} is taken by another program; choose another endpoint with --listen, "
            f"or join what is there with mode auto"
        )

    def with_roles(self) -> str:
        """The sentence for a server with roles, which would have to leave them to the other one."""
        return (
            f"{self.endpoint} is taken, and a server that gives roles to its clients does not join another one, whose "
            f"rules do not know its topics; choose another endpoint with --listen, such as --listen "
            f"{on_free_port(self.endpoint)}"
        )

    def way_out(self) -> str:
        """The sentence for when it is certain that the program is not one to join."""
        return (
            f"{self.endpoint} is taken by another program that does not speak Zenoh (or does not let us in); "
            f"choose another endpoint with --listen, such as --listen {on_free_port(self.endpoint)} that is free now, "
            f"or --listen {DEFAULT_LISTEN.rpartition(':')[0]}:0 for any free one"
        )


class Plan:
    """The settings laid over the configuration file."""

    def __init__(self, settings: SessionSettings, name: str) -> None:
        self._settings = settings
        self._name = name
        file = self._base()
        said: str | None = json.loads(file.get_json("mode"))
        self.mode: Mode = said if settings.mode == "auto" and said else settings.mode  # type: ignore[assignment]
        self.connect = settings.connect or _endpoints(file, "connect", "peer")
        self.listens = settings.listen is not None or file.get_json("listen") != zenoh.Config().get_json("listen")

    def listen(self, role: Role) -> tuple[str, ...]:
        """Returns the endpoints to listen on, ports not yet chosen."""
        if role == "client":
            return ()
        file = self._base()
        said = _endpoints(file, "listen", role) if self.listens else ()
        default = DEFAULT_LISTEN if role == "router" else "tcp/127.0.0.1:0"
        return (said or (default,)) if self._settings.listen is None else self._settings.listen

    def open(
        self, role: Role, listen: tuple[str, ...], connect: tuple[str, ...]
    ) -> tuple[zenoh.Session, tuple[str, ...]]:
        """Opens the session, unless the name is taken.

        Returns:
            The session, and the endpoints it listens on, with their actual ports.

        Raises:
            TakenError: Another program listens on one of the endpoints.
            UnreachableError: A client reaches none of the endpoints to connect to.
            WireError: Anything else went wrong.
        """
        if role == "client" and not connect:
            raise WireError("mode client needs an endpoint to connect to; give one with --connect")
        for endpoint in connect if self._name else ():
            with self.visit(endpoint) as visitor:
                if visitor is not None:
                    identity.refuse_duplicate(visitor, self._name)
        for _ in range(_RACES):
            listening = tuple(with_free_port(endpoint) for endpoint in listen)
            config = self._with_access(self._config(role, listening, connect))
            try:
                session = self._session(config, listening)
            except zenoh.ZError as error:
                if not _IN_USE.search(str(error)):
                    kind = UnreachableError if role == "client" else WireError
                    raise kind(_trouble(listening, connect, error)) from error
                at = next((i for i, endpoint in enumerate(listening) if endpoint in str(error)), 0)
                if not has_free_port(listen[at]):
                    raise TakenError(listening[at]) from error
            else:
                return session, listening
        raise WireError(f"found no free port for {', '.join(listen)} in {_RACES} attempts")

    def host(self, listen: tuple[str, ...]) -> zenoh.Session | None:
        """Opens a router for others; returns None if another program listens on one of the endpoints already.

        Raises:
            WireError: It cannot listen there for another reason.
        """
        config = self._config("router", listen, ())
        try:
            return self._session(config, listen)
        except zenoh.ZError as error:
            if _IN_USE.search(str(error)):
                return None
            raise WireError(_trouble(listen, (), error)) from error

    def join(self, connect: tuple[str, ...]) -> zenoh.Session:
        """Opens a client's session.

        Raises:
            WireError: Nobody lets us in.
        """
        config = self._config("client", (), connect, queues.WORKER_DROP_WAIT_US)
        # The rules say what others may do on the server's links; on this link the server applies them.
        _set(config, "access_control/enabled", False)
        try:
            return self._session(config)
        except zenoh.ZError as error:
            hint = why_worker_is_refused(config, self._settings.config, connect)
            raise WireError(f"{_trouble((), connect, error)}{hint}") from error

    @contextmanager
    def visit(self, endpoint: str) -> Iterator[zenoh.Session | None]:
        """Connects as a short-lived client; gives None where nothing answers as Zenoh."""
        config = self._config("client", (), (dialable(endpoint),))
        _set(config, "transport/unicast/open_timeout", _PROBE_MS)
        _set(config, "connect/timeout_ms", _PROBE_MS)
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
            raise WireError(_trouble(listening, connect, error)) from error
        _set_default(config, "scouting/multicast/enabled", False)
        _set_default(config, "timestamping/enabled", True)
        if role == "router" and not connect:
            # A router waits this long for others to answer, though there is nobody it could have asked.
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
            raise WireError(f"cannot use the Zenoh configuration file {path}: {_plain(error)}") from error


def _endpoints(config: zenoh.Config, key: Literal["listen", "connect"], role: Role) -> tuple[str, ...]:
    """Reads endpoints, which a file may give per mode."""
    said = json.loads(config.get_json(f"{key}/endpoints"))
    return tuple(said.get(role, ()) if isinstance(said, dict) else said or ())


def _set(config: zenoh.Config, key: str, value: Any) -> None:
    config.insert_json5(key, json.dumps(value))


def _set_default(config: zenoh.Config, key: str, value: Any) -> None:
    if json.loads(config.get_json(key)) is None:
        _set(config, key, value)


def _trouble(listening: tuple[str, ...], connect: tuple[str, ...], error: zenoh.ZError) -> str:
    wanted = [f"{verb} {', '.join(them)}" for verb, them in (("listen on", listening), ("connect to", connect)) if them]
    return f"cannot {' and '.join(wanted) or 'open a Zenoh session'}: {_plain(error)}"


def _plain(error: zenoh.ZError) -> str:
    """A Zenoh error without the places in its source code."""
    return _SOURCE_PLACE.sub("", str(error)).strip()
