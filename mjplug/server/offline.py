"""A transport without a network, and workers that do nothing. `mjplug serve --check` starts the plugins with them."""

from collections.abc import Callable, Iterable
from typing import Any

import mujoco

from mjplug.contracts.actions import ActionCallbacks, ActionName, ActionPublishers
from mjplug.contracts.cdr_frame import CdrFrame
from mjplug.contracts.transport import BytesQuery, Call, ServiceName, Topic
from mjplug.contracts.work import WorkerSpec, WorkerStatus
from mjplug.physics.inbox import Inbox
from mjplug.physics.simulation import Simulation
from mjplug_schemas.message import Message


class OfflinePublisher:
    """A publisher without subscribers."""

    matched = False
    tap: Callable[[Message | CdrFrame], None] | None = None

    def publish(self, message: Message) -> None:
        """Discards the message."""

    def publish_frame(self, frame: CdrFrame) -> None:
        """Discards the frame."""

    def put(self, payload: bytes) -> None:
        """Drops the bytes."""


class OfflineTransport:
    """Records what is declared, and delivers nothing.

    Attributes:
        published: The topics with a publisher.
        subscribed: The topics with a subscriber.
        services: The services, with those of actions.
        actions: The actions.
    """

    def __init__(self) -> None:
        self.published: list[Topic[Any]] = []
        self.subscribed: list[Topic[Any]] = []
        self.services: list[ServiceName] = []
        self.actions: list[ActionName] = []

    def open_publisher(self, topic: Topic[Any], on_matched: Callable[[], None] | None = None) -> OfflinePublisher:
        """Records the topic, and returns a publisher without subscribers."""
        self.published.append(topic)
        return OfflinePublisher()

    def open_subscription(self, topic: Topic[Any], deliver: Callable[[Any], None]) -> None:
        """Records the topic."""
        self.subscribed.append(topic)

    def open_service(self, service: ServiceName, deliver: Callable[[Call], None]) -> None:
        """Records the service."""
        self.services.append(service)

    def open_action(self, action: ActionName, callbacks: ActionCallbacks) -> ActionPublishers:
        """Records the action, its services and its topics."""
        self.actions.append(action)
        self.services += action.services
        return ActionPublishers(*map(self.open_publisher, action.topics))

    def open_bytes_publisher(self, key: str, encoding: str, on_matched: Callable[[], None]) -> OfflinePublisher:
        """Returns a publisher without subscribers."""
        return OfflinePublisher()

    def open_bytes_subscription(self, key: str, limit: int, deliver: Callable[[bytes], None]) -> None:
        """Delivers nothing."""

    def open_bytes_queryable(self, key: str, deliver: Callable[[BytesQuery], None]) -> None:
        """Delivers nothing."""

    def watch_leaving(self, keys: str, left: Callable[[str], None]) -> None:
        """Reports nothing."""

    def watch_tokens(self, keys: str, changed: Callable[[str, bool], None]) -> None:
        """Reports no token."""


class OfflineWorker:
    """A worker that never becomes ready."""

    def __init__(self) -> None:
        self.status = WorkerStatus()

    def submit(self, tasks: Iterable[str], answered: bool = False, context: Any = None) -> None:
        """Does nothing."""

    def stop(self) -> None:
        """Does nothing."""


class OfflineWorkerPool:
    """A pool that starts no process."""

    def start(self, spec: WorkerSpec, simulation: Simulation, inbox: Inbox) -> OfflineWorker:
        """Returns a worker that does nothing."""
        return OfflineWorker()

    def prepare(self, model: mujoco.MjModel) -> None:
        """Does nothing."""

    def close(self) -> None:
        """Does nothing."""
