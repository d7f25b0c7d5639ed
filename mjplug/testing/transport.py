"""A transport without a network. Tests send messages and requests to plugins, and read what plugins publish."""

from collections import defaultdict
from collections.abc import Callable
from typing import Any

from mjplug.contracts.actions import ActionCallbacks, ActionName, ActionPublishers
from mjplug.contracts.cdr_frame import CdrFrame
from mjplug.contracts.transport import BytesQuery, Call, QoS, ServiceName, Topic
from mjplug.server.local_calls import LocalCall
from mjplug.testing.goals import FakeGoal
from mjplug_schemas.action import Action
from mjplug_schemas.message import Message, Service


class FakePublisher:
    """Stores published messages. Implements `mjplug.contracts.transport.Publisher`.

    Attributes:
        matched: Whether the topic has a subscriber. Initially true; a test may change it.
        messages: The messages, oldest first. Frames are decoded.
        on_matched: The plugin's function to call when the first subscriber appears; None if it has none.
    """

    def __init__(self, on_matched: Callable[[], None] | None = None) -> None:
        self._subscribed = True
        self.messages: list[Any] = []
        self.on_matched = on_matched
        self.tap: Callable[[Message | CdrFrame], None] | None = None

    @property
    def matched(self) -> bool:
        """Whether the topic has a subscriber, or a tap."""
        return self._subscribed or self.tap is not None

    @matched.setter
    def matched(self, subscribed: bool) -> None:
        self._subscribed = subscribed

    def publish(self, message: Message) -> None:
        """Stores a message."""
        if self.tap is not None:
            self.tap(message)
        self.messages.append(message)

    def publish_frame(self, frame: CdrFrame) -> None:
        """Stores the message in a frame."""
        if self.tap is not None:
            self.tap(frame)
        self.messages.append(frame.type.from_cdr(frame.payload()))


class FakeBytesPublisher:
    """Keeps the published bytes. Implements `mjplug.contracts.transport.BytesPublisher`.

    Attributes:
        matched: Whether the key has a subscriber; false at first, and may be changed.
        payloads: The payloads, the first one first.
        on_matched: Called by the transport when a first subscriber appears.
    """

    def __init__(self, on_matched: Callable[[], None]) -> None:
        self.matched = False
        self.payloads: list[bytes] = []
        self.on_matched = on_matched

    def put(self, payload: bytes) -> None:
        """Keeps the payload."""
        self.payloads.append(payload)


class FakeTransport:
    """Topics and services by their full ROS names. Implements `mjplug.contracts.transport.Transport`.

    Attributes:
        publishers: The publishers, by topic.
        types: The type of each topic and service.
        qos: The quality of service of each published topic.
        bytes_publishers: The publishers of bytes, by key.
        bytes_subscriptions: The functions that get the bytes of a subscription, by key.
        queryables: The functions that get the queries of a queryable, by key.
        watched: The functions that are called when a liveliness token disappears, by key expression.
        tokens: The functions that are called when a liveliness token appears or disappears, by key expression.
    """

    def __init__(self) -> None:
        self.publishers: dict[str, FakePublisher] = {}
        self.types: dict[str, Any] = {}
        self.qos: dict[str, QoS] = {}
        self.bytes_publishers: dict[str, FakeBytesPublisher] = {}
        self.bytes_subscriptions: dict[str, Callable[[bytes], None]] = {}
        self.queryables: dict[str, Callable[[BytesQuery], None]] = {}
        self.watched: dict[str, Callable[[str], None]] = {}
        self.tokens: dict[str, Callable[[str, bool], None]] = {}
        self._subscriptions: dict[str, list[Callable[[Any], None]]] = defaultdict(list)
        self._services: dict[str, Callable[[Call], None]] = {}
        self._actions: dict[str, ActionCallbacks] = {}

    @property
    def actions(self) -> set[str]:
        """The names of all actions."""
        return set(self._actions)

    @property
    def services(self) -> set[str]:
        """The names of all services."""
        return set(self._services)

    @property
    def subscriptions(self) -> set[str]:
        """The names of all topics with a subscriber."""
        return set(self._subscriptions)

    def open_publisher(self, topic: Topic[Any], on_matched: Callable[[], None] | None = None) -> FakePublisher:
        """Declares a publisher."""
        publisher = self.publishers[topic.name] = FakePublisher(on_matched)
        self.types[topic.name], self.qos[topic.name] = topic.type, topic.qos
        return publisher

    def open_subscription(self, topic: Topic[Any], deliver: Callable[[Any], None]) -> None:
        """Declares a subscription."""
        self._subscriptions[topic.name].append(deliver)
        self.types[topic.name] = topic.type

    def open_service(self, service: ServiceName, deliver: Callable[[Call], None]) -> None:
        """Declares a service."""
        self._services[service.name] = deliver
        self.types[service.name] = service.type

    def open_action(self, action: ActionName, callbacks: ActionCallbacks) -> ActionPublishers:
        """Declares an action, its three services and its two topics."""
        self._actions[action.name] = callbacks
        self.types[action.name] = action.type
        for service, deliver in zip(
            action.services, (callbacks.send_goal, callbacks.cancel_goal, callbacks.get_result), strict=True
        ):
            self.open_service(service, deliver)
        return ActionPublishers(*map(self.open_publisher, action.topics))

    def open_bytes_publisher(self, key: str, encoding: str, on_matched: Callable[[], None]) -> FakeBytesPublisher:
        """Declares a publisher of bytes."""
        publisher = self.bytes_publishers[key] = FakeBytesPublisher(on_matched)
        return publisher

    def open_bytes_subscription(self, key: str, limit: int, deliver: Callable[[bytes], None]) -> None:
        """Declares a subscription to bytes."""
        self.bytes_subscriptions[key] = deliver

    def open_bytes_queryable(self, key: str, deliver: Callable[[BytesQuery], None]) -> None:
        """Declares a queryable."""
        self.queryables[key] = deliver

    def watch_leaving(self, keys: str, left: Callable[[str], None]) -> None:
        """Watches liveliness tokens."""
        self.watched[keys] = left

    def watch_tokens(self, keys: str, changed: Callable[[str, bool], None]) -> None:
        """Watches liveliness tokens."""
        self.tokens[keys] = changed

    def send(self, name: str, message: Message) -> None:
        """Sends a message to the subscribers of a topic. They handle it before the next step.

        Args:
            name: The topic's full name.
            message: The message.

        Raises:
            KeyError: No plugin subscribes to the topic.
        """
        if name not in self._subscriptions:
            raise KeyError(
                f"no plugin subscribes to {name}; topics: {', '.join(sorted(self._subscriptions)) or 'none'}"
            )
        for deliver in self._subscriptions[name]:
            deliver(message)

    def call(self, name: str, request: Message | None = None, **parameters: str) -> LocalCall:
        """Sends a request to a service, which handles it before the next step.

        Args:
            name: The service's full name.
            request: The request; None means a request with default values.
            **parameters: Parameters of the selector, such as `wait="false"`.

        Returns:
            The call, which will contain the response.

        Raises:
            KeyError: No plugin provides the service.
        """
        if name not in self._services:
            raise KeyError(f"no plugin provides {name}; services: {', '.join(sorted(self._services)) or 'none'}")
        service: type[Service] = self.types[name]
        call = LocalCall(service.Request() if request is None else request, parameters)
        self.deliver(name, call)
        return call

    def deliver(self, name: str, call: Call) -> None:
        """Sends a request to a service, which answers the call.

        Args:
            name: The service's full name; a plugin must provide it.
            call: The request.
        """
        self._services[name](call)

    def send_goal(self, name: str, goal: Message | None = None, **parameters: str) -> FakeGoal:
        """Sends a goal to an action, which handles it before the next step.

        Args:
            name: The action's full name.
            goal: The goal; None means a goal with default values.
            **parameters: Parameters of the selector, such as `goal_id`.

        Returns:
            The goal, which will contain feedback and result.

        Raises:
            KeyError: No plugin provides the action.
        """
        if name not in self._actions:
            raise KeyError(f"no plugin provides {name}; actions: {', '.join(sorted(self._actions)) or 'none'}")
        action: type[Action] = self.types[name]
        sent = FakeGoal(action.Goal() if goal is None else goal, parameters)
        self._actions[name].query(sent)
        return sent
