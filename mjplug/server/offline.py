"""A transport that goes nowhere, and workers that do nothing: `mjplug serve --check` starts every plugin with them."""

from collections.abc import Callable, Iterable
from typing import Any

from mjplug.contracts.cdr_frame import CdrFrame
from mjplug.contracts.transport import Call, ServiceName, Topic
from mjplug.contracts.work import WorkerSpec, WorkerStatus
from mjplug.physics.inbox import Inbox
from mjplug.physics.simulation import Simulation
from mjplug_schemas.message import Message


class OfflinePublisher:
    """Publishes to nobody."""

    matched = False

    def publish(self, message: Message) -> None:
        """Drops the message."""

    def publish_frame(self, frame: CdrFrame) -> None:
        """Drops the frame."""


class OfflineTransport:
    """Accepts every endpoint, and delivers nothing.

    Attributes:
        published: The topics that are published.
        subscribed: The topics that are subscribed to.
        services: The services.
    """

    def __init__(self) -> None:
        self.published: list[Topic[Any]] = []
        self.subscribed: list[Topic[Any]] = []
        self.services: list[ServiceName] = []

    def open_publisher(self, topic: Topic[Any], on_matched: Callable[[], None] | None = None) -> OfflinePublisher:
        """Returns a publisher without listeners."""
        self.published.append(topic)
        return OfflinePublisher()

    def open_subscription(self, topic: Topic[Any], deliver: Callable[[Any], None]) -> None:
        """Notes the topic."""
        self.subscribed.append(topic)

    def open_service(self, service: ServiceName, deliver: Callable[[Call], None]) -> None:
        """Notes the service."""
        self.services.append(service)


class OfflineWorker:
    """Is never ready."""

    def __init__(self) -> None:
        self.status = WorkerStatus()

    def submit(self, tasks: Iterable[str], answered: bool = False) -> None:
        """Does nothing."""


class OfflineWorkerPool:
    """Accepts every order, and starts nothing."""

    def start(self, spec: WorkerSpec, simulation: Simulation, inbox: Inbox) -> OfflineWorker:
        """Returns a worker that does nothing."""
        return OfflineWorker()

    def close(self) -> None:
        """Does nothing."""
