"""A publisher of one topic. A message is encoded once for each form that has subscribers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from zenoh import Session, ZBytes

from mjplug.contracts.cdr_frame import CdrFrame
from mjplug.contracts.transport import Topic
from mjplug.wire.dialect import KeyWriter, RemoteWriterSpec
from mjplug.wire.origin import Now, no_time
from mjplug_schemas.message import Message

M = TypeVar("M", bound=Message)


class WirePublisher(Generic[M]):
    """Implements `mjplug.contracts.transport.Publisher`. Physics thread only.

    Attributes:
        topic: The topic.
        writers: The writers, one for each key.
        sent: Number of messages that this process published.
        remote: Whether a worker process publishes the topic instead of this process.
        tap: Also gets each published message or frame; None for none.

    Args:
        topic: The topic.
        writers: The writers, one for each key.
    """

    def __init__(self, topic: Topic[M], writers: Sequence[KeyWriter]) -> None:
        self.topic = topic
        self.tap: Callable[[Message | CdrFrame], None] | None = None
        self.sent = 0
        self.remote = False
        self.writers = tuple(writers)
        self._cdr = tuple(writer for writer in writers if writer.form == "cdr")
        self._json = tuple(writer for writer in writers if writer.form == "json")

    @property
    def matched(self) -> bool:
        """Whether the topic has a subscriber or a tap. Always true for a latched topic, because of late subscribers."""
        for writer in self.writers:
            if writer.matched:
                return True
        return self.tap is not None

    def publish(self, message: M) -> None:
        """Publishes a message; without subscribers, it is not encoded."""
        self._check(type(message))
        self.sent += 1
        if self.tap is not None:
            self.tap(message)
        payload: ZBytes | None = None
        for writer in self._cdr:
            if writer.matched:
                if payload is None:
                    payload = ZBytes(message.to_cdr())
                writer.put(payload)
        payload = None
        for writer in self._json:
            if writer.matched:
                if payload is None:
                    payload = ZBytes(message.to_json())
                writer.put(payload)

    def publish_frame(self, frame: CdrFrame) -> None:
        """Publishes a prebuilt frame; for JSON subscribers it is decoded and encoded again."""
        self._check(frame.type)
        self.sent += 1
        if self.tap is not None:
            self.tap(frame)
        payload: ZBytes | None = None
        for writer in self._cdr:
            if writer.matched:
                if payload is None:
                    # This copies, so that the next values can be written at once.
                    payload = ZBytes(frame.buffer)
                writer.put(payload)
        payload = None
        for writer in self._json:
            if writer.matched:
                if payload is None:
                    payload = ZBytes(frame.type.from_cdr(frame.buffer).to_json())
                writer.put(payload)

    def publish_cdr(self, data: bytes) -> None:
        """Publishes a message that is encoded in CDR already; for JSON subscribers it is decoded and encoded again."""
        self.sent += 1
        payload: ZBytes | None = None
        for writer in self._cdr:
            if writer.matched:
                if payload is None:
                    payload = ZBytes(data)
                writer.put(payload)
        payload = None
        for writer in self._json:
            if writer.matched:
                if payload is None:
                    payload = ZBytes(self.topic.type.from_cdr(data).to_json())
                writer.put(payload)

    def remote_spec(self) -> "RemotePublisherSpec":
        """Returns the data with which another process can publish this topic in place of the server."""
        self.remote = True
        return RemotePublisherSpec(self.topic, tuple(writer.remote_spec() for writer in self.writers))

    def _check(self, given: type[Any]) -> None:
        if given is not self.topic.type:
            raise TypeError(f"topic {self.topic.name} has type {self.topic.type.TYPE}, not {given.__name__}")


@dataclass(frozen=True, slots=True)
class RemotePublisherSpec:
    """The data with which another process publishes a topic in place of the server. Picklable.

    Attributes:
        topic: The topic.
        writers: The data of the writers.
    """

    topic: Topic[Any]
    writers: tuple[RemoteWriterSpec, ...]

    def open(self, session: Session, on_matched: Callable[[], None], now: Now = no_time) -> WirePublisher[Any]:
        """Declares the publisher on another session.

        Args:
            session: The session.
            on_matched: Called when a writer gets its first subscriber.
            now: Returns the simulated time and the epoch of the messages.
        """
        # Compile the encoder now, as the server does.
        self.topic.type().to_cdr()
        return WirePublisher(self.topic, [writer.open(session, on_matched, now) for writer in self.writers])
