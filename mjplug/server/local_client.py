"""Steps a server inside its own process, without a network. The handlers are those of requests over Zenoh."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import mujoco

from mjplug.client.driver import Driver
from mjplug.client.errors import RequestRefused, TimedOutError, UnknownNameError, WrongTypeError
from mjplug.client.states import StateCalls
from mjplug.client.types import Fields, as_message
from mjplug.contracts.transport import ServiceName
from mjplug.errors import MjplugError, RequestError
from mjplug.server.local_calls import AwaitedCall, LocalCall
from mjplug.server.opened import OpenedServer
from mjplug_schemas.message import Message, Service

_CHECK_INTERVAL = 0.5
"""Interval in which a waiting thread checks whether the server still runs [s]."""

Serve = Callable[[LocalCall], None]
"""Handles requests on the calling thread until a call is answered."""


class LocalClient(Driver, StateCalls):
    """A client in the process of the server, with the functions of `Client` that step it, save it and call services.

    Args:
        name: Full name of the server.
        opened: The server.
        serve: Handles requests until a call is answered, if the calling thread takes the steps; None if another thread
            runs the server.
        running: Returns whether the server runs.
    """

    def __init__(self, name: str, opened: OpenedServer, serve: Serve | None, running: Callable[[], bool]) -> None:
        self._opened = opened
        self._serve = serve
        self._running = running
        self._name = name
        self._services: dict[str, ServiceName] = {}

    @property
    def model(self) -> mujoco.MjModel:
        """The compiled model, to be read only."""
        return self._opened.prepared.simulation.model

    def call(
        self, name: str, message: Message | Fields | None = None, *, timeout: float | None = None, **fields: Any
    ) -> Any:
        """Calls a service of the server and returns its response.

        Args:
            name: The service, such as `~/reset_world`.
            message: The request, or nested dictionaries of its fields.
            timeout: How long to wait [s of wall time]; None for no limit. Not used with `run=False`.
            **fields: The fields of the request, instead of `message`.

        Raises:
            RequestRefused: The request was refused.
            UnknownNameError: The server does not offer the service.
            WrongTypeError: The request has another type than the service, or is given twice.
        """
        if message is not None and fields:
            raise WrongTypeError(f"the request is given twice: as a message, and as {', '.join(fields)}")
        return self._call_with({}, name, fields if message is None else message, timeout)

    def _call_with(self, parameters: Mapping[str, str], name: str, request: Any, timeout: float | None) -> Any:
        service = self._find(name)
        return self._ask(service, as_message(request, service.type.Request), timeout, parameters)

    def release(self) -> None:
        """Lets clients on the network step the server; the next `step` owns it again."""
        ownership, owner = self._opened.server.ownership, self._opened.owner["owner"]
        self._opened.server.loop.inbox.post(lambda: ownership.release(owner))

    def _exchange(
        self, name: str, service: type[Service], request: Message, duration: float, timeout: float | None
    ) -> Any:
        return self._ask(self._find(name), request, timeout)

    def _message_class(self, topic: str) -> tuple[str, type[Message]]:
        name = self._resolve(topic)
        topics = self._opened.server.topics
        try:
            return name, topics.readers(name)[0].topic.type
        except RequestError:
            raise UnknownNameError("topic that the server reads", topic, sorted(topics.read)) from None

    def _find(self, name: str) -> ServiceName:
        service = self._services.get(name)
        if service is None:
            calls = self._opened.calls
            try:
                service = self._services[name] = calls.find(self._resolve(name))
            except RequestError:
                raise UnknownNameError("service", name, calls.names) from None
        return service

    def _resolve(self, name: str) -> str:
        return f"{self._name}/{name.removeprefix('~/')}" if name.startswith("~/") else f"/{name.removeprefix('/')}"

    def _ask(
        self,
        service: ServiceName,
        request: Message,
        timeout: float | None,
        parameters: Mapping[str, str] = MappingProxyType({}),
    ) -> Any:
        given = {**self._opened.owner, **parameters} if parameters else self._opened.owner
        call = self._served(service, request, given) if self._serve else self._awaited(service, request, given, timeout)
        if call.refusal is not None:
            raise RequestRefused(service.name, call.refusal)
        if getattr(call.response, "success", True) is False:
            raise RequestRefused(service.name, getattr(call.response, "message", ""), call.response)
        return call.response

    def _served(self, service: ServiceName, request: Message, parameters: Mapping[str, str]) -> LocalCall:
        assert self._serve is not None
        call = LocalCall(request, parameters)
        self._opened.calls.send(service, call)
        self._serve(call)
        return call

    def _awaited(
        self, service: ServiceName, request: Message, parameters: Mapping[str, str], timeout: float | None
    ) -> LocalCall:
        call = AwaitedCall(request, parameters)
        self._opened.calls.send(service, call)
        left = float("inf") if timeout is None else timeout
        while not call.ended.wait(min(left, _CHECK_INTERVAL)):
            left -= _CHECK_INTERVAL
            if left <= 0.0:
                raise TimedOutError(f"no answer from {service.name} within {timeout:g} s")
            if not self._running():
                raise MjplugError(f"the server {self._name} was stopped")
        return call
