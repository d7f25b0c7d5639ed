"""One topic that the server publishes: a message is encoded once per form that somebody listens to."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from zenoh import Session, ZBytes

from mjplug.frame import CdrFrame
from mjplug.transport import Topic
from mjplug.wire.dialect import Outlet, OutletLease
from mjplug_schemas.message import Message

M = TypeVar("M", bound=Message)


class WirePublisher(Generic[M]):
    """Implements `mjplug.transport.Publisher`. Physics thread only.

    Attributes:
        topic: What is published.
        outlets: Where to.
        sent: How many messages were published here.
        leased: Whether another process publishes in place of this one.

    Args:
        topic: As above.
        outlets: As above.
    """

    def __init__(self, topic: Topic[M], outlets: Sequence[Outlet]) -> None:
        self.topic = topic
        self.sent = 0
        self.leased = False
        self.outlets = tuple(outlets)
        self._cdr = tuple(outlet for outlet in outlets if outlet.form == "cdr")
        self._json = tuple(outlet for outlet in outlets if outlet.form == "json")

    @property
    def matched(self) -> bool:
        """Whether anybody listens. Always true of a latched topic: those who listen later count too."""
        for outlet in self.outlets:  # noqa: SIM110 - called at every step, and a generator costs four times as much
            if outlet.matched:
                return True
        return False

    def publish(self, message: M) -> None:
        """Sends a message to those who listen; with nobody there, it is not even encoded."""
        self._check(type(message))
        self.sent += 1
        payload: ZBytes | None = None
        for outlet in self._cdr:
            if outlet.matched:
                if payload is None:
                    payload = ZBytes(message.to_cdr())
                outlet.put(payload)
        payload = None
        for outlet in self._json:
            if outlet.matched:
                if payload is None:
                    payload = ZBytes(message.to_json())
                outlet.put(payload)

    def publish_frame(self, frame: CdrFrame) -> None:
        """Sends a prebuilt frame; for JSON listeners it is decoded and encoded again."""
        self._check(frame.type)
        self.sent += 1
        payload: ZBytes | None = None
        for outlet in self._cdr:
            if outlet.matched:
                if payload is None:
                    # Copies, so that the next values may be written at once.
                    payload = ZBytes(frame.buffer)
                outlet.put(payload)
        payload = None
        for outlet in self._json:
            if outlet.matched:
                if payload is None:
                    payload = ZBytes(frame.type.from_cdr(frame.buffer).to_json())
                outlet.put(payload)

    def lease(self) -> "PublisherLease":
        """Returns what another process needs to publish this topic in place of the server."""
        self.leased = True
        return PublisherLease(self.topic, tuple(outlet.lease() for outlet in self.outlets))

    def _check(self, given: type[Any]) -> None:
        if given is not self.topic.type:
            raise TypeError(f"topic {self.topic.name} carries {self.topic.type.TYPE}, not {given.__name__}")


@dataclass(frozen=True, slots=True)
class PublisherLease:
    """A topic to publish in place of the server; it pickles.

    Attributes:
        topic: What is published.
        outlets: Where to.
    """

    topic: Topic[Any]
    outlets: tuple[OutletLease, ...]

    def open(self, session: Session, on_matched: Callable[[], None]) -> WirePublisher[Any]:
        """Declares the publisher on another session; `on_matched` is called when an outlet gets its first listener."""
        # Compiles the encoder now, as the server does.
        self.topic.type().to_cdr()
        return WirePublisher(self.topic, [outlet.open(session, on_matched) for outlet in self.outlets])
