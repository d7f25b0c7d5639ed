"""A subscription of the server: decodes, validates and delivers messages. Runs on Zenoh's threads."""

import logging
from collections.abc import Callable
from typing import Generic, TypeVar

from mjplug.contracts.transport import Topic
from mjplug.wire.encoding import DEFAULT_LIMITS, Decoder, Limits, PayloadError, Received
from mjplug.wire.rejections import Rejections
from mjplug_schemas.message import Message

M = TypeVar("M", bound=Message)

_LOG = logging.getLogger(__name__)


class Subscription(Generic[M]):
    """Decodes the messages of one topic.

    Attributes:
        topic: The topic.
        rejections: Counts samples that are not valid messages.

    Args:
        topic: The topic.
        deliver: Called with each message; it may only enqueue.
        limits: Size limits of messages.
    """

    def __init__(self, topic: Topic[M], deliver: Callable[[M], None], limits: Limits = DEFAULT_LIMITS) -> None:
        self.rejections = Rejections(f"topic {topic.name}: a sample was refused")
        self.topic = topic
        self._deliver = deliver
        self._decoder = Decoder(topic.type, limits)

    def receive(self, received: Received) -> None:
        """Handles one sample. Never raises, because it runs on Zenoh's thread."""
        try:
            _, message = self._decoder.decode(received)
        except PayloadError as error:
            self.rejections.add(str(error))
            return
        try:
            self._deliver(message)
        except Exception:
            _LOG.exception("topic %s: delivering a message failed", self.topic.name)
