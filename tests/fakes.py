"""A transport without a network: tests send messages and requests by hand and read what came out."""

from collections import defaultdict
from collections.abc import Callable, Mapping
from typing import Any

from mjplug.frame import CdrFrame
from mjplug.transport import QoS, ServiceName, Topic
from mjplug_schemas.message import Message


class FakeCall:
    """A request and, once it is there, its answer."""

    def __init__(self, request: Message, parameters: Mapping[str, str]) -> None:
        self.request = request
        self.parameters = parameters
        self.response: Any = None
        self.refusal: str | None = None
        self.answers = 0

    @property
    def answered(self) -> bool:
        return self.answers > 0

    def respond(self, response: Message) -> None:
        if not self.answered:
            self.response = response
        self.answers += 1

    def refuse(self, reason: str) -> None:
        if not self.answered:
            self.refusal = reason
        self.answers += 1


class FakePublisher:
    """Keeps what was published."""

    def __init__(self, on_matched: Callable[[], None] | None) -> None:
        self.matched = True
        self.messages: list[Any] = []
        self.on_matched = on_matched

    def publish(self, message: Message) -> None:
        self.messages.append(message)

    def publish_frame(self, frame: CdrFrame) -> None:
        self.messages.append(frame.type.from_cdr(frame.payload()))


class FakeTransport:
    """Endpoints by their full ROS names."""

    def __init__(self) -> None:
        self.publishers: dict[str, FakePublisher] = {}
        self.types: dict[str, type] = {}
        self.qos: dict[str, QoS] = {}
        self._subscriptions: dict[str, list[Callable[[Any], None]]] = defaultdict(list)
        self._services: dict[str, Callable[[Any], None]] = {}

    def open_publisher(self, topic: Topic[Any], on_matched: Callable[[], None] | None = None) -> FakePublisher:
        self.publishers[topic.name] = FakePublisher(on_matched)
        self.types[topic.name], self.qos[topic.name] = topic.type, topic.qos
        return self.publishers[topic.name]

    def open_subscription(self, topic: Topic[Any], deliver: Callable[[Any], None]) -> None:
        self._subscriptions[topic.name].append(deliver)
        self.types[topic.name] = topic.type

    def open_service(self, service: ServiceName, deliver: Callable[[Any], None]) -> None:
        self._services[service.name] = deliver
        self.types[service.name] = service.type

    @property
    def services(self) -> set[str]:
        return set(self._services)

    @property
    def subscriptions(self) -> set[str]:
        return set(self._subscriptions)

    def send(self, name: str, message: Message) -> None:
        for deliver in self._subscriptions[name]:
            deliver(message)

    def call(self, name: str, request: Message | None = None, **parameters: str) -> FakeCall:
        call = FakeCall(request if request is not None else self.types[name].Request(), parameters)
        self._services[name](call)
        return call
