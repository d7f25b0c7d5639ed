"""The transport of the server: one Zenoh session and its dialects."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from importlib.metadata import version
from typing import Any, TypeVar

from mjplug.contracts.actions import ActionCallbacks, ActionName, ActionPublishers
from mjplug.contracts.transport import BytesQuery, Call, ServiceName, Topic
from mjplug.errors import WireError
from mjplug.wire import identity
from mjplug.wire.actions import GoalReceiver
from mjplug.wire.bytes_endpoints import BytesEndpoints, WireBytesPublisher
from mjplug.wire.calls import MAX_OPEN_CALLS, OpenCalls
from mjplug.wire.dialect import Dialect
from mjplug.wire.discovery.answers import ActionEntry, Direction, InterfacesQueryable, Listing, ServiceEntry, TopicEntry
from mjplug.wire.encoding import DEFAULT_LIMITS, Limits
from mjplug.wire.origin import Now, no_time
from mjplug.wire.plain import PlainDialect
from mjplug.wire.publisher import WirePublisher
from mjplug.wire.rmw_zenoh.dialect import RmwZenohDialect
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.rmw_zenoh.node_services import offer_node_services
from mjplug.wire.service import ServiceServer
from mjplug.wire.session import SessionSettings, WireSession, open_session
from mjplug.wire.shared_names import SharedNamesWatch
from mjplug.wire.subscription import Subscription
from mjplug_schemas.message import Message

M = TypeVar("M", bound=Message)


class Network:
    """Implements `mjplug.contracts.actions.ActionTransport`.

    Publishers, subscriptions and services are declared on one thread; their callbacks run on Zenoh's threads.

    Attributes:
        session: The session.
        open_calls: The requests that wait for their response.
        publishers: All publishers of the server, including those that worker processes use.

    Args:
        session: An open session. The network closes it.
        name: The server's full name, such as `/robot1/mjplug`.
        dialects: The dialects; each topic and service is declared in all of them.
        limits: Size limits of received messages and requests.
        max_open_calls: Maximum number of requests that wait at the same time, for all services of one type.
    """

    def __init__(
        self,
        session: WireSession,
        name: str,
        dialects: Sequence[Dialect],
        limits: Limits = DEFAULT_LIMITS,
        max_open_calls: int = MAX_OPEN_CALLS,
    ) -> None:
        self.session = session
        self.open_calls = OpenCalls(max_open_calls)
        self._dialects = tuple(dialects)
        self._limits = limits
        self.publishers: list[WirePublisher[Any]] = []
        self._types: dict[str, type[Message]] = {}
        self._servers: dict[str, ServiceServer] = {}
        self._goals: dict[str, GoalReceiver] = {}
        self._subscriptions: list[Subscription[Any]] = []
        self._bytes = BytesEndpoints(session.zenoh)
        listing = Listing(name, version("mjplug"), session.endpoint)
        self._interfaces = InterfacesQueryable(session.zenoh, listing, self._refresh)
        # After the queryable, because a client that sees the token may query the list at once.
        self._claim = identity.claim(session.zenoh, name)
        self._shared: SharedNamesWatch | None = None

    @property
    def listing(self) -> Listing:
        """The list of all declared topics, services and actions."""
        return self._interfaces.listing

    def open_publisher(self, topic: Topic[M], on_matched: Callable[[], None] | None = None) -> WirePublisher[M]:
        """Declares a publisher.

        Args:
            topic: The topic.
            on_matched: Called on Zenoh's thread each time one of the topic's keys gets its first subscriber. It is not
                called for a latched topic, which is published even without subscribers.

        Raises:
            WireError: The topic already exists with another type.
        """
        publisher = self._declare_publisher(topic, on_matched or _nothing)
        self._list_topic(topic, "published")
        return publisher

    def open_subscription(self, topic: Topic[M], deliver: Callable[[M], None]) -> None:
        """Declares a subscription.

        Args:
            topic: The topic. Its depth is not applied here: every valid message is delivered.
            deliver: Called with each message on Zenoh's threads; it may only enqueue.

        Raises:
            WireError: The topic already exists with another type.
        """
        self._check(topic)
        topic.type.from_cdr(topic.type().to_cdr())
        subscription = Subscription(topic, deliver, self._limits)
        self._subscriptions.append(subscription)
        for dialect in self._dialects:
            dialect.declare_subscribers(topic, subscription.receive)
        self._list_topic(topic, "subscribed")

    def open_service(self, service: ServiceName, deliver: Callable[[Call], None]) -> None:
        """Declares a service.

        Args:
            service: The service.
            deliver: Called with each request on Zenoh's threads; it may only enqueue.

        Raises:
            WireError: A service of this name already exists.
        """
        entry = self._declare_service(service, deliver)
        self._interfaces.listing = replace(self.listing, services=(*self.listing.services, entry))

    def open_action(self, action: ActionName, callbacks: ActionCallbacks) -> ActionPublishers:
        """Declares an action: its services, its topics, and the queryable on its own name.

        Args:
            action: The action.
            callbacks: Called on Zenoh's threads; they may only enqueue.

        Raises:
            WireError: An action, or one of its services, already exists.
        """
        if action.name in self._servers:
            raise WireError(f"the service {action.name} already exists; give the action another name")
        receiver = self._goals[action.name] = GoalReceiver(action, callbacks.query, self.open_calls, self._limits)
        deliver = (callbacks.send_goal, callbacks.cancel_goal, callbacks.get_result)
        services = tuple(map(self._declare_service, action.services, deliver))
        publishers = ActionPublishers(*(self._declare_publisher(topic, _nothing) for topic in action.topics))
        topics = tuple(self._topic_entry(topic, "published") for topic in action.topics)
        keys: dict[str, str] = {}
        for dialect in self._dialects:
            dialect.declare_action(action, receiver.receive)
            keys |= dialect.action_keys(action)
        entry = ActionEntry(action, keys, services, topics)
        self._interfaces.listing = replace(self.listing, actions=(*self.listing.actions, entry))
        return publishers

    def open_bytes_publisher(self, key: str, encoding: str, on_matched: Callable[[], None]) -> WireBytesPublisher:
        """Declares a publisher of bytes; see `mjplug.contracts.transport.BytesTransport`."""
        return self._bytes.open_publisher(key, encoding, on_matched)

    def open_bytes_subscription(self, key: str, limit: int, deliver: Callable[[bytes], None]) -> None:
        """Declares a subscription to bytes; see `mjplug.contracts.transport.BytesTransport`."""
        self._bytes.open_subscription(key, limit, deliver)

    def open_bytes_queryable(self, key: str, deliver: Callable[[BytesQuery], None]) -> None:
        """Declares a queryable; see `mjplug.contracts.transport.BytesTransport`."""
        self._bytes.open_queryable(key, deliver)

    def watch_leaving(self, keys: str, left: Callable[[str], None]) -> None:
        """Watches liveliness tokens; see `mjplug.contracts.transport.BytesTransport`."""
        self._bytes.watch_leaving(keys, left)

    def watch_tokens(self, keys: str, changed: Callable[[str, bool], None]) -> None:
        """Watches liveliness tokens; see `mjplug.contracts.transport.BytesTransport`."""
        self._bytes.watch_tokens(keys, changed)

    def watch_shared_names(self, exempt: Iterable[str] = ()) -> None:
        """Announces to other servers that all names are declared, and logs a warning about shared names.

        Args:
            exempt: Types of topics that are not reported.
        """
        self._shared = SharedNamesWatch(self.session.zenoh, lambda: self.listing, exempt)

    def refused(self) -> dict[str, int]:
        """Returns the number of messages and requests that could not be decoded, by topic or service name."""
        counts: Counter[str] = Counter()
        for subscription in self._subscriptions:
            counts[subscription.topic.name] += subscription.rejections.count
        for name, server in self._servers.items():
            counts[name] += server.rejections.count
        for name, goals in self._goals.items():
            counts[name] += goals.rejections.count
        for dialect in self._dialects:
            counts.update(dialect.refused())
        return dict(counts)

    def busy(self) -> dict[str, int]:
        """Returns the number of requests that were refused because too many were waiting, by service name."""
        return {name: server.busy.count for name, server in self._servers.items()}

    def refuse_open_calls(self, reason: str) -> None:
        """Refuses every waiting request."""
        self.open_calls.refuse_all(reason)

    def close(self, reason: str = "the server is stopping") -> None:
        """Refuses the waiting requests, makes publishers unmatched and closes the session; may be called twice."""
        for dialect in self._dialects:
            dialect.close()
        self._bytes.close()
        self.open_calls.close(reason)
        self.session.close()
        if self._shared is not None:
            # After the session, because closing the session also ends a waiting query.
            self._shared.close()

    def _refresh(self, key: str) -> bool:
        """Updates the matching status of the publishers of a key; returns whether one has a subscriber. Any thread."""
        writers = [writer for publisher in tuple(self.publishers) for writer in publisher.writers]
        # All of them, because two publishers may share a topic.
        found = [writer.refresh(key) for writer in writers]
        return any(found)

    def _check(self, topic: Topic[Any]) -> None:
        known = self._types.setdefault(topic.name, topic.type)
        if known is not topic.type:
            raise WireError(
                f"topic {topic.name} already exists with type {known.TYPE}; it cannot also have type {topic.type.TYPE}"
            )

    def _declare_publisher(self, topic: Topic[M], notify: Callable[[], None]) -> WirePublisher[M]:
        self._check(topic)
        # Compile the encoder now, not at the first step that publishes.
        topic.type().to_cdr()
        writers = [writer for dialect in self._dialects for writer in dialect.declare_writers(topic, notify)]
        publisher = WirePublisher(topic, writers)
        self.publishers.append(publisher)
        return publisher

    def _declare_service(self, service: ServiceName, deliver: Callable[[Call], None]) -> ServiceEntry:
        if service.name in self._servers or service.name in self._goals:
            raise WireError(f"the service {service.name} already exists; give one of the two another name")
        server = self._servers[service.name] = ServiceServer(service, deliver, self.open_calls, self._limits)
        keys: dict[str, str] = {}
        for dialect in self._dialects:
            dialect.declare_service(service, server.receive)
            keys |= dialect.service_keys(service)
        return ServiceEntry(service, keys)

    def _topic_entry(self, topic: Topic[Any], direction: Direction) -> TopicEntry:
        keys = {name: key for dialect in self._dialects for name, key in dialect.topic_keys(topic).items()}
        return TopicEntry(topic, direction, keys)

    def _list_topic(self, topic: Topic[Any], direction: Direction) -> None:
        entry = self._topic_entry(topic, direction)
        self._interfaces.listing = replace(self.listing, topics=(*self.listing.topics, entry))


def open_network(
    settings: SessionSettings,
    name: str,
    limits: Limits = DEFAULT_LIMITS,
    max_open_calls: int = MAX_OPEN_CALLS,
    ros2: RosSettings | None = None,
    now: Now = no_time,
) -> Network:
    """Opens the session of a server and returns its network.

    Args:
        settings: The session's settings.
        name: The server's full name, such as `/robot1/mjplug`.
        limits: Size limits of received messages and requests.
        max_open_calls: Maximum number of requests that wait at the same time, for all services of one type.
        ros2: Settings of the rmw_zenoh dialect; None uses the plain dialect only.
        now: Returns the simulated time and the epoch, for the attachments of messages. Physics thread.

    Raises:
        WireError: The session cannot be opened, or another server has the name.
    """
    session = open_session(settings, name)
    try:
        plain = PlainDialect(session.zenoh, name, now)
        if ros2 is None:
            return Network(session, name, [plain], limits, max_open_calls)
        rmw_zenoh = RmwZenohDialect(session.zenoh, name, ros2)
        network = Network(session, name, [plain, rmw_zenoh], limits, max_open_calls)
        offer_node_services(rmw_zenoh, name, ros2, network.open_calls)
        return network
    except BaseException:
        # An open session would prevent the process from ending.
        session.close()
        raise


def _nothing() -> None:
    pass
