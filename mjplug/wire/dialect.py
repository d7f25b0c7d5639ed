"""The seam for another way to speak: how one ROS name becomes Zenoh entities, behind what publishers and services see.

A dialect knows keys, encodings, attachments and tokens. It declares writers for a publisher, subscribers for a
subscription, and queryables for a service. It knows neither message values nor what is done with them.
"""

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import zenoh

from mjplug.contracts.transport import ServiceName, Topic
from mjplug.wire.encoding import Form, Received


class KeyWriter(Protocol):
    """One key that a publisher writes to."""

    @property
    def form(self) -> Form:
        """What it carries."""

    @property
    def matched(self) -> bool:
        """Whether a put reaches anybody, now or as a late joiner."""

    def put(self, payload: zenoh.ZBytes) -> None:
        """Sends an encoded message. Physics thread."""

    def refresh(self, key: str) -> bool:
        """Brings `matched` up to date if this is the writer's key; returns whether a subscriber was found. Any thread.

        `matched` follows subscribers with a delay.
        """

    def look(self) -> None:
        """Brings `matched` up to date, whatever the key; it takes about 6 µs. Any thread."""

    def remote_spec(self) -> "RemoteWriterSpec":
        """Returns what another process needs to write to this key as if it were the server."""


class RemoteWriterSpec(Protocol):
    """The right to write to a key in place of the server, which keeps the tokens and the listing. It pickles."""

    def open(self, session: zenoh.Session, on_matched: Callable[[], None]) -> KeyWriter:
        """Declares the writer on another session; `on_matched` is to be called when it gets its first listener."""


class RawRequest(Protocol):
    """One request as it came, with a way back. Answered or dropped once, from any thread."""

    @property
    def received(self) -> Received:
        """The encoded request."""

    @property
    def size(self) -> int:
        """What Zenoh keeps of the request until it is answered [bytes]."""

    @property
    def parameters(self) -> Mapping[str, str]:
        """The selector's parameters."""

    @property
    def needs_response(self) -> bool:
        """Whether the client needs a response of the type in any case: an error reply leaves ROS clients hanging."""

    def reply(self, payload: bytes, form: Form) -> None:
        """Sends the encoded response, and ends the request."""

    def reply_error(self, sentence: str) -> None:
        """Answers that there is no response, and ends the request."""


class Dialect(Protocol):
    """One way to put topics and services on Zenoh. The callbacks it is given come back on Zenoh's threads."""

    def topic_keys(self, topic: Topic[Any]) -> Mapping[str, str]:
        """Returns the keys of a topic, by the names that the listing of interfaces gives them."""

    def service_keys(self, service: ServiceName) -> Mapping[str, str]:
        """Returns the keys of a service, likewise."""

    def declare_writers(self, topic: Topic[Any], on_matched: Callable[[], None]) -> list[KeyWriter]:
        """Declares what a publisher needs; `on_matched` is to be called when a writer gets its first listener."""

    def declare_subscribers(self, topic: Topic[Any], receive: Callable[[Received], None]) -> None:
        """Declares what a subscription needs."""

    def declare_service(self, service: ServiceName, receive: Callable[[RawRequest], None]) -> None:
        """Declares what a service needs."""

    def refused(self) -> Mapping[str, int]:
        """Returns how many queries could not even be read as requests, by the name of the service."""

    def close(self) -> None:
        """Makes every writer unmatched, for good; the session undeclares the rest."""
