"""A transport that goes nowhere: lets `mjplug serve --check` start every plugin without a network."""

from collections.abc import Callable
from typing import Any

from mjplug.frame import CdrFrame
from mjplug.transport import Call, ServiceName, Topic
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
