"""One topic that the server publishes: a message is encoded once per form that somebody listens to."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from zenoh import Session, ZBytes

from mjplug.contracts.cdr_frame import CdrFrame
from mjplug.contracts.transport import Topic
from mjplug.wire.dialect import KeyWriter, RemoteWriterSpec
from mjplug_schemas.message import Message

M = TypeVar("M", bound=Message)


class WirePublisher(Generic[M]):
    """Implements `mjplug.contracts.transport.Publisher`. Physics thread only.

    Attributes:
        topic: What is published.
        writers: Where to.
        sent: How many messages were published here.
        remote: Whether another process publishes in place of this one.

    Args:
        topic: As above.
        writers: As above.
    """

    def __init__(self, topic: Topic[M], writers: Sequence[KeyWriter]) -> None:
        self.topic = topic
        self.sent = 0
        self.remote = False
        self.writers = tuple(writers)
        self._cdr = tuple(writer for writer in writers if writer.form == "cdr")
        self._json = tuple(writer for writer in writers if writer.form == "json")

    @property
    def matched(self) -> bool:
        """Whether anybody listens. Always true of a latched topic: those who listen later count too."""
        for writer in self.writers:  # noqa: SIM110 - called at every step, and a generator costs four times as much
            if writer.matched:
                return True
        return False

    def publish(self, message: M) -> None:
        """Sends a message to those who listen; with nobody there, it is not even encoded."""
        self._check(type(message))
        self.sent += 1
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
        """Sends a prebuilt frame; for JSON listeners it is decoded and encoded again."""
        self._check(frame.type)
        self.sent += 1
        payload: ZBytes | None = None
        for writer in self._cdr:
            if writer.matched:
                if payload is None:
                    # Copies, so that the next values may be written at once.
                    payload = ZBytes(frame.buffer)
                writer.put(payload)
        payload = None
        for writer in self._json:
            if writer.matched:
                if payload is None:
                    payload = ZBytes(frame.type.from_cdr(frame.buffer).to_json())
                writer.put(payload)

    def remote_spec(self) -> "RemotePublisherSpec":
        """Returns what another process needs to publish this topic in place of the server."""
        self.remote = True
        return RemotePublisherSpec(self.topic, tuple(writer.remote_spec() for writer in self.writers))

    def _check(self, given: type[Any]) -> None:
        if given is not self.topic.type:
            raise TypeError(f"topic {self.topic.name} carries {self.topic.type.TYPE}, not {given.__name__}")


@dataclass(frozen=True, slots=True)
class RemotePublisherSpec:
    """A topic to publish in place of the server; it pickles.

    Attributes:
        topic: What is published.
        writers: Where to.
    """

    topic: Topic[Any]
    writers: tuple[RemoteWriterSpec, ...]

    def open(self, session: Session, on_matched: Callable[[], None]) -> WirePublisher[Any]:
        """Declares the publisher on another session; `on_matched` is called when a writer gets its first listener."""
        # Compiles the encoder now, as the server does.
        self.topic.type().to_cdr()
        return WirePublisher(self.topic, [writer.open(session, on_matched) for writer in self.writers])
