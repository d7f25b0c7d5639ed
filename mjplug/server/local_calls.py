"""Requests to a server's services from its own process, without a network."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, TypeVar

from mjplug.contracts.transport import Call, Publisher, ServiceName, Topic, Transport
from mjplug_schemas.message import Message, Service

M = TypeVar("M", bound=Message)


class LocalCall:
    """A request, and its response when there is one. Implements `mjplug.contracts.transport.Call`.

    Attributes:
        request: The request.
        parameters: As those of a selector, such as `{"wait": "false"}`.
        response: The response; None until the service has answered, and after a refusal.
        refusal: Why the request was refused; None if it was not.
        answers: How often the service has answered; only the first answer counts.
    """

    def __init__(self, request: Message, parameters: Mapping[str, str] = MappingProxyType({})) -> None:
        self.request = request
        self.parameters = parameters
        self.response: Any = None
        self.refusal: str | None = None
        self.answers = 0

    @property
    def answered(self) -> bool:
        """Whether there is a response or a refusal."""
        return self.answers > 0

    def respond(self, response: Message) -> None:
        """Keeps the response, unless there is an answer already."""
        if not self.answered:
            self.response = response
        self.answers += 1

    def refuse(self, reason: str) -> None:
        """Keeps the reason, unless there is an answer already."""
        if not self.answered:
            self.refusal = reason
        self.answers += 1


class LocalCalls:
    """A transport whose services can be called from this process too, on the same way through the physics thread.

    Args:
        transport: Where everything is declared.
    """

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self._services: dict[ServiceName, Callable[[Call], None]] = {}

    def open_publisher(self, topic: Topic[M], on_matched: Callable[[], None] | None = None) -> Publisher[M]:
        """Declares a publisher."""
        return self._transport.open_publisher(topic, on_matched)

    def open_subscription(self, topic: Topic[Any], deliver: Callable[[Any], None]) -> None:
        """Declares a subscription."""
        self._transport.open_subscription(topic, deliver)

    def open_service(self, service: ServiceName, deliver: Callable[[Call], None]) -> None:
        """Declares a service, and keeps the way to it."""
        self._transport.open_service(service, deliver)
        self._services[service] = deliver

    def send(self, type: type[Service], request: Message) -> LocalCall:
        """Sends a request to the first service of a type: the server's own come before those of plugins.

        Args:
            type: The service's class.
            request: The request.

        Returns:
            The call; the physics thread answers it.
        """
        deliver = next(deliver for service, deliver in self._services.items() if service.type is type)
        call = LocalCall(request)
        deliver(call)
        return call
