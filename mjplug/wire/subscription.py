"""One topic that the server reads. Runs on Zenoh's threads: decodes, checks, hands over."""

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
    """Decodes what comes in on a topic.

    Attributes:
        topic: What is read.
        rejections: The samples that were no valid message.

    Args:
        topic: What is read.
        deliver: Gets each message; it must only enqueue.
        limits: How much is accepted.
    """

    def __init__(self, topic: Topic[M], deliver: Callable[[M], None], limits: Limits = DEFAULT_LIMITS) -> None:
        self.rejections = Rejections(f"topic {topic.name}: a sample was refused")
        self.topic = topic
        self._deliver = deliver
        self._decoder = Decoder(topic.type, limits)

    def receive(self, received: Received) -> None:
        """Takes one sample. Never raises: Zenoh's thread has other work to do."""
        try:
            _, message = self._decoder.decode(received)
        except PayloadError as error:
            self.rejections.add(str(error))
            return
        try:
            self._deliver(message)
        except Exception:
            _LOG.exception("topic %s: a message could not be handed over", self.topic.name)
