"""Requests to a server's services from its own process, without a network."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Literal, TypeVar

from mjplug.contracts.actions import ActionCallbacks, ActionName, ActionPublishers, ActionTransport
from mjplug.contracts.cdr_frame import CdrFrame
from mjplug.contracts.transport import BytesPublisher, BytesQuery, Call, Publisher, ServiceName, Topic
from mjplug.errors import UnknownName
from mjplug.wakeup import Flag
from mjplug_schemas.message import Message, Service

M = TypeVar("M", bound=Message)


class LocalCall:
    """A request, and its response when there is one. Implements `mjplug.contracts.transport.Call`.

    Attributes:
        request: The request.
        parameters: The parameters of a Zenoh selector, such as `{"wait": "false"}`.
        response: The response; None until the service has answered, and after a refusal.
        refusal: The reason for which the request was refused; None if it was not.
        answers: Number of answers from the service; only the first one counts.
    """

    form: Literal["cdr", "json", "message"] = "message"

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
        """Stores the response, unless the service has already answered."""
        if not self.answered:
            self.response = response
        self.answers += 1

    def respond_frame(self, frame: CdrFrame) -> None:
        """Stores a copy of the response in a frame."""
        self.respond(frame.type.from_cdr(frame.payload()))

    def refuse(self, reason: str) -> None:
        """Stores the reason, unless the service has already answered."""
        if not self.answered:
            self.refusal = reason
        self.answers += 1


class AwaitedCall(LocalCall):
    """A request for whose answer another thread than the physics thread waits.

    Attributes:
        ended: Whether there is an answer.
    """

    def __init__(self, request: Message, parameters: Mapping[str, str] = MappingProxyType({})) -> None:
        super().__init__(request, parameters)
        self.ended = Flag()

    def respond(self, response: Message) -> None:
        """Stores the response, and wakes the thread that waits."""
        super().respond(response)
        self.ended.set()

    def refuse(self, reason: str) -> None:
        """Stores the reason, and wakes the thread that waits."""
        super().refuse(reason)
        self.ended.set()


class LocalCalls:
    """A transport whose services can also be called from this process. The physics thread handles these calls too.

    Args:
        transport: Declares the publishers, subscribers and services.
    """

    def __init__(self, transport: ActionTransport) -> None:
        self._transport = transport
        self._services: dict[ServiceName, Callable[[Call], None]] = {}

    def open_publisher(self, topic: Topic[M], on_matched: Callable[[], None] | None = None) -> Publisher[M]:
        """Declares a publisher."""
        return self._transport.open_publisher(topic, on_matched)

    def open_subscription(self, topic: Topic[Any], deliver: Callable[[Any], None]) -> None:
        """Declares a subscription."""
        self._transport.open_subscription(topic, deliver)

    def open_service(self, service: ServiceName, deliver: Callable[[Call], None]) -> None:
        """Declares a service, and stores its callback for `send`."""
        self._transport.open_service(service, deliver)
        self._services[service] = deliver

    def open_action(self, action: ActionName, callbacks: ActionCallbacks) -> ActionPublishers:
        """Declares an action, and stores the callbacks of its services for `send`."""
        publishers = self._transport.open_action(action, callbacks)
        self._services[action.send_goal] = callbacks.send_goal
        self._services[action.cancel_goal] = callbacks.cancel_goal
        self._services[action.get_result] = callbacks.get_result
        return publishers

    def open_bytes_publisher(self, key: str, encoding: str, on_matched: Callable[[], None]) -> BytesPublisher:
        """Declares a publisher of bytes."""
        return self._transport.open_bytes_publisher(key, encoding, on_matched)

    def open_bytes_subscription(self, key: str, limit: int, deliver: Callable[[bytes], None]) -> None:
        """Declares a subscription to bytes."""
        self._transport.open_bytes_subscription(key, limit, deliver)

    def open_bytes_queryable(self, key: str, deliver: Callable[[BytesQuery], None]) -> None:
        """Declares a queryable that replies with bytes."""
        self._transport.open_bytes_queryable(key, deliver)

    def watch_leaving(self, keys: str, left: Callable[[str], None]) -> None:
        """Watches liveliness tokens."""
        self._transport.watch_leaving(keys, left)

    def watch_tokens(self, keys: str, changed: Callable[[str, bool], None]) -> None:
        """Watches liveliness tokens, with existing ones."""
        self._transport.watch_tokens(keys, changed)

    def find(self, name: str) -> ServiceName:
        """Returns the service of a full name.

        Raises:
            UnknownName: There is no such service.
        """
        for service in tuple(self._services):
            if service.name == name:
                return service
        raise UnknownName("service", name, self.names)

    @property
    def names(self) -> list[str]:
        """Full names of all services."""
        return sorted(service.name for service in tuple(self._services))

    def first(self, type: type[Service]) -> ServiceName:
        """Returns the first service of a type. The server declares its own services before those of plugins."""
        return next(service for service in self._services if service.type is type)

    def send(self, service: ServiceName, call: LocalCall) -> None:
        """Sends a request, which the physics thread answers. May be called from any thread.

        Args:
            service: The service.
            call: The request, and later the answer.
        """
        self._services[service](call)
