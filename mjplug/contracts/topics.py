"""The topics of a server as one step request uses them: messages to read first, and samples of what is published."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from mjplug.contracts.cdr_frame import CdrFrame
from mjplug.contracts.remote_samples import RemoteSamples
from mjplug.contracts.transport import Publisher, Topic
from mjplug.errors import UnknownName
from mjplug_schemas.message import Message

Sampler = Callable[[], "Message | CdrFrame"]
"""Returns the message of a topic for the present state."""


@dataclass(frozen=True, slots=True)
class ReadTopic:
    """A subscription of the server.

    Attributes:
        topic: The topic.
        handle: Handles a message at once, on the physics thread; raises RequestError if it refuses the message.
    """

    topic: Topic[Any]
    handle: Callable[[Any], None]


class PublishedTopic:
    """A publisher of the server, and the newest message that it has published while it was observed.

    Attributes:
        topic: The topic.
        publisher: Its publisher.
        sample: Returns the message for the present state; None if only the publisher's own messages are available.
        remote: The samples of the worker process that publishes the topic, and the index of the publisher there; None
            if this process publishes it.

    Args:
        topic: As above.
        publisher: As above.
        sample: As above.
        wake: Resumes the timers that sleep while the topic has no subscriber.
        step: Returns the number of steps taken so far.
    """

    def __init__(
        self,
        topic: Topic[Any],
        publisher: Publisher[Any],
        sample: Sampler | None,
        wake: Callable[[], None],
        step: Callable[[], int],
    ) -> None:
        self.topic = topic
        self.publisher = publisher
        self.sample = sample
        self._wake = wake
        self._step = step
        self.remote: tuple[RemoteSamples, int] | None = None
        self._observers = 0
        self._newest: tuple[int, Message | bytes] | None = None
        # The last message of a latched topic is part of the topic, so it is always kept.
        self._latched = topic.qos.durability == "transient_local"
        if self._latched:
            publisher.tap = self._keep

    def observe(self) -> None:
        """Keeps the messages from now on, until `leave` has been called as often as `observe`."""
        if self.sample is not None or self.remote is not None:
            return
        self._observers += 1
        if not self._latched and self._observers == 1:
            self._newest = None
            self.publisher.tap = self._keep
            self._wake()

    def leave(self) -> None:
        """Ends an observation."""
        if self.sample is not None or self.remote is not None:
            return
        self._observers -= 1
        if not self._latched and self._observers == 0:
            self.publisher.tap = None

    def newest(self) -> tuple[bytes, bool]:
        """Returns a message in CDR, and whether it describes the present state.

        The message is empty if none has been published since `observe`.
        """
        if self.sample is not None:
            return _cdr(self.sample()), True
        if self._newest is None:
            return b"", False
        step, message = self._newest
        return message if isinstance(message, bytes) else message.to_cdr(), step == self._step()

    def _keep(self, message: Message | CdrFrame) -> None:
        # A frame is copied, because its next values replace its content.
        self._newest = self._step(), message.payload() if isinstance(message, CdrFrame) else message


def _cdr(message: Message | CdrFrame) -> bytes:
    return message.payload() if isinstance(message, CdrFrame) else message.to_cdr()


@dataclass(slots=True)
class Topics:
    """The topics of a server by full name. Several plugin instances may read or publish one topic.

    Attributes:
        read: The subscriptions.
        published: The publishers.
    """

    read: dict[str, list[ReadTopic]] = field(default_factory=dict)
    published: dict[str, list[PublishedTopic]] = field(default_factory=dict)

    def readers(self, name: str) -> list[ReadTopic]:
        """Returns the subscriptions of a topic.

        Raises:
            UnknownName: The server does not subscribe to it.
        """
        if name not in self.read:
            raise UnknownName("topic that the server reads", name, sorted(self.read))
        return self.read[name]

    def publishers(self, name: str) -> list[PublishedTopic]:
        """Returns the publishers of a topic.

        Raises:
            UnknownName: The server does not publish it.
        """
        if name not in self.published:
            raise UnknownName("topic that the server publishes", name, sorted(self.published))
        return self.published[name]
