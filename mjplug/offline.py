"""A transport that goes nowhere, and workers that do nothing: `mjplug serve --check` starts every plugin with them."""

from collections.abc import Callable, Iterable
from typing import Any

from mjplug.core.inbox import Inbox
from mjplug.core.simulation import Simulation
from mjplug.frame import CdrFrame
from mjplug.transport import Call, ServiceName, Topic
from mjplug.work import Health, Order
from mjplug_schemas.message import Message


class OfflinePublisher:
    """Publishes to nobody."""

    matched = False

    def publish(self, message: Message) -> None:
        """Drops the message."""

    def publish_frame(self, frame: CdrFrame) -> None:
        """Drops the frame."""


class OfflineTransport:
    """Accepts every endpoint, and delivers nothing."""

    def open_publisher(self, topic: Topic[Any], on_matched: Callable[[], None] | None = None) -> OfflinePublisher:
        """Returns a publisher without listeners."""
        return OfflinePublisher()

    def open_subscription(self, topic: Topic[Any], deliver: Callable[[Any], None]) -> None:
        """Does nothing."""

    def open_service(self, service: ServiceName, deliver: Callable[[Call], None]) -> None:
        """Does nothing."""


class OfflineWorker:
    """Is never ready."""

    def __init__(self) -> None:
        self.health = Health()

    def submit(self, tasks: Iterable[str], answered: bool = False) -> None:
        """Does nothing."""


class OfflineWorkers:
    """Accepts every order, and starts nothing."""

    def start(self, order: Order, simulation: Simulation, inbox: Inbox) -> OfflineWorker:
        """Returns a worker that does nothing."""
        return OfflineWorker()

    def close(self) -> None:
        """Does nothing."""
