"""What one page sends to servers: service calls, messages, drags."""

import asyncio
import json
import logging
from dataclasses import dataclass
from typing import Any

import zenoh

from mjplug.client import request as requests
from mjplug.client.errors import ClientError, RequestRefused, WrongTypeError
from mjplug.client.types import as_message, known, message_class, to_json
from mjplug.view.network import Network
from mjplug.view.queries import RefusedError, ask
from mjplug.view.values import shown
from mjplug.wire.discovery.format import ServiceInfo
from mjplug.wire.encoding import encoding_of
from mjplug_schemas import names

_log = logging.getLogger(__name__)

MAX_CALLS = 32
"""Maximum number of service calls of one page that wait for their response."""

MAX_STOPS = 64
"""Maximum number of topics for which one page has given a `stop` message."""

STOP_TIMEOUT = 0.5
"""Default time after which `stop` is published [s]."""

_READING_TYPES = (
    "rcl_interfaces/srv/DescribeParameters",
    "rcl_interfaces/srv/GetParameterTypes",
    "rcl_interfaces/srv/GetParameters",
    "rcl_interfaces/srv/ListParameters",
)
_READING_NAMES = ("get_", "list_", "describe_")

READ_ONLY = "this view is read-only (--read-only)"


class Calls:
    """The service calls of one page.

    Args:
        network: The network.
        read_only: Whether only services that change nothing may be called.
    """

    def __init__(self, network: Network, read_only: bool) -> None:
        self._network = network
        self._read_only = read_only
        self._waiting = 0

    async def call(self, name: object, fields: object, server: object = None) -> Any:
        """Calls a service and returns its response as JSON values.

        Args:
            name: The service.
            fields: The fields of the request; missing fields have their initial values.
            server: Id of the server for `~`.

        Raises:
            ClientError: There is no such service, the request is invalid, the server refuses it or does not answer, or
                too many calls are waiting.
        """
        if self._waiting >= MAX_CALLS:
            raise ClientError(f"{MAX_CALLS} service calls are waiting, which is the maximum; try again later")
        self._waiting += 1
        try:
            servers = self._network.servers
            service = await servers.service(servers.resolve(name, server))
            if self._read_only and not _reads(service):
                raise ClientError(f"{service.name} may change the simulation, and {READ_ONLY}")
            return await self._send(service, {} if fields is None else fields)
        finally:
            self._waiting -= 1

    async def _send(self, service: ServiceInfo, fields: object) -> Any:
        session = self._network.session
        kind = known(service.type)
        if kind is None:
            payload = to_json(fields)
            encoding: Any = zenoh.Encoding.APPLICATION_JSON
            timeout = requests.MARGIN
        else:
            message = as_message(fields, kind.Request)
            payload, encoding = bytes(message.to_cdr()), encoding_of("cdr", kind.Request)
            timeout = requests.default_timeout(message, self._speed(service.server))
        try:
            answer = await ask(session, service.key, timeout, payload, encoding)
        except RefusedError as error:
            raise RequestRefused(service.name, str(error)) from None
        return json.loads(answer if kind is None else kind.Response.from_cdr(answer).to_json())

    def _speed(self, name: str) -> float:
        """Returns the speed of a server, if a page watches it."""
        for watched in self._network.all_watched():
            speed = (watched.info or {}).get("speed")
            if watched.server.name == name and isinstance(speed, int | float) and speed > 0:
                return float(speed)
        return 1.0


def _reads(service: ServiceInfo) -> bool:
    return service.type in _READING_TYPES or service.name.rpartition("/")[2].startswith(_READING_NAMES)


@dataclass(frozen=True, slots=True)
class _Target:
    """A topic to publish on.

    Attributes:
        key: Its key.
        kind: The message class; None sends JSON.
    """

    key: str
    kind: Any

    def encode(self, fields: object) -> tuple[bytes, Any]:
        """Returns payload and encoding of a message."""
        if self.kind is None:
            return to_json(fields), zenoh.Encoding.APPLICATION_JSON
        return bytes(as_message(fields, self.kind).to_cdr()), encoding_of("cdr", self.kind)


class Publishing:
    """The messages that one page publishes, and the messages that stop what they started.

    Args:
        network: The network.
    """

    def __init__(self, network: Network) -> None:
        self._network = network
        self._targets: dict[tuple[str, str], _Target] = {}
        self._stops: dict[str, tuple[asyncio.TimerHandle, bytes, Any]] = {}

    async def publish(self, message: dict[str, Any]) -> None:
        """Publishes the message in a `publish` request.

        Raises:
            ClientError: The topic is unknown, a message does not match its type, or access rules forbid to publish.
        """
        target = await self._target(message)
        timeout = message.get("timeout", STOP_TIMEOUT)
        if isinstance(timeout, bool) or not isinstance(timeout, int | float) or not 0.0 < timeout <= 60.0:
            raise ClientError(f"timeout is {shown(timeout)}; it must be a number above 0, and at most 60 [s]")
        payload, encoding = target.encode(message.get("message", {}))
        # Encoded now, so that an invalid message is refused and not found when it is needed.
        stop = target.encode(message["stop"]) if message.get("stop") is not None else None
        if stop is not None and target.key not in self._stops and len(self._stops) >= MAX_STOPS:
            raise ClientError(f"there are `stop` messages for {MAX_STOPS} topics, which is the maximum")
        self._forget(target.key)
        sent = self._network.publish(target.key, payload, encoding)
        if stop is not None:
            timer = asyncio.get_running_loop().call_later(timeout, self._stop, target.key)
            self._stops[target.key] = timer, *stop
        # A page that publishes faster than the link waits here.
        await sent

    def close(self) -> None:
        """Publishes all `stop` messages that have not been published."""
        for key in tuple(self._stops):
            self._stop(key)

    async def _target(self, message: dict[str, Any]) -> _Target:
        servers = self._network.servers
        full = servers.resolve(message.get("topic"), message.get("server"))
        given = message.get("type")
        if given is not None and not isinstance(given, str):
            raise ClientError(f"type is {shown(given)}; it must be a string such as geometry_msgs/msg/Twist")
        target = self._targets.get((full, given or ""))
        if target is not None:
            return target
        topics = await servers.topics()
        actual = topics[full].type if full in topics else None
        if given is not None and actual not in (None, given):
            raise WrongTypeError(f"topic {full} is {actual}, not {given}")
        if actual is None and given is None:
            # Raises an error that lists the topics.
            await servers.topic(full)
        name = actual or given or ""
        # A type that only the server knows is sent as JSON.
        kind = known(name) if actual is not None else message_class(name)
        for subscriber in topics[full].subscribers if actual is not None else ():
            await self._network.permissions.require(servers.by_name(subscriber))
        target = _Target(names.key(full), kind)
        if actual is not None:
            self._targets[full, given or ""] = target
        return target

    def _stop(self, key: str) -> None:
        timer, payload, encoding = self._stops.pop(key)
        timer.cancel()
        self._network.publish(key, payload, encoding).add_done_callback(_report)

    def _forget(self, key: str) -> None:
        if key in self._stops:
            self._stops.pop(key)[0].cancel()


def _report(sent: "asyncio.Future[None]") -> None:
    if not sent.cancelled() and (error := sent.exception()) is not None:
        _log.error("a `stop` message could not be published: %s", error)
