"""The interface of a dialect: how topics and services are mapped to Zenoh.

A dialect defines keys, encodings, attachments and liveliness tokens. It declares writers for a publisher, subscribers
for a subscription, and queryables for a service. It does not handle decoded messages.
"""

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import zenoh

from mjplug.contracts.actions import ActionName
from mjplug.contracts.transport import ServiceName, Topic
from mjplug.wire.encoding import Form, Received, WrittenForm
from mjplug.wire.origin import Now


class KeyWriter(Protocol):
    """A key to which a publisher writes."""

    @property
    def form(self) -> WrittenForm:
        """The form of the payloads."""

    @property
    def matched(self) -> bool:
        """Whether the key has a subscriber. Always true for a latched topic, because of late subscribers."""

    def put(self, payload: zenoh.ZBytes) -> None:
        """Sends an encoded message. Physics thread."""

    def refresh(self, key: str) -> bool:
        """Updates `matched` at once if `key` is the writer's key; returns whether a subscriber was found. Any thread.

        Without it, `matched` follows new subscribers with a delay.
        """

    def refresh_matched(self) -> None:
        """Updates `matched` at once; takes about 6 µs. Any thread."""

    def remote_spec(self) -> "RemoteWriterSpec":
        """Returns the data with which another process can write to this key in place of the server."""


class RemoteWriterSpec(Protocol):
    """The data with which another process writes to a key in place of the server. Picklable.

    The server keeps the liveliness tokens and the list of interfaces.
    """

    def open(self, session: zenoh.Session, on_matched: Callable[[], None], now: Now) -> KeyWriter:
        """Declares the writer on another session.

        Args:
            session: The session.
            on_matched: Called when the writer gets its first subscriber.
            now: Returns the simulated time and the epoch of the messages.
        """


class RawRequest(Protocol):
    """An encoded request and the means to reply to it. Any thread may reply, once."""

    @property
    def received(self) -> Received:
        """The encoded request."""

    @property
    def size(self) -> int:
        """Size of the data that Zenoh keeps until the request is answered [bytes]."""

    @property
    def parameters(self) -> Mapping[str, str]:
        """The selector's parameters."""

    @property
    def needs_response(self) -> bool:
        """Whether the client needs a response of the service's type, because it waits for ever after an error reply."""

    def reply(self, payload: bytes, form: Form) -> None:
        """Sends the encoded response and ends the request."""

    def reply_error(self, sentence: str) -> None:
        """Sends an error reply and ends the request."""


class RawGoal(RawRequest, Protocol):
    """An encoded goal of an action, which gets several replies."""

    def reply_part(self, payload: bytes, encoding: zenoh.Encoding) -> None:
        """Sends one of several replies; `end` must follow."""

    def end(self) -> None:
        """Ends the request after the last part."""


class Dialect(Protocol):
    """A mapping of topics and services to Zenoh. Callbacks run on Zenoh's threads."""

    def topic_keys(self, topic: Topic[Any]) -> Mapping[str, str]:
        """Returns the keys of a topic, by their field names in the list of interfaces."""

    def service_keys(self, service: ServiceName) -> Mapping[str, str]:
        """Returns the keys of a service, by their field names in the list of interfaces."""

    def declare_writers(self, topic: Topic[Any], on_matched: Callable[[], None]) -> list[KeyWriter]:
        """Declares the writers of a publisher; `on_matched` is called when a writer gets its first subscriber."""

    def declare_subscribers(self, topic: Topic[Any], receive: Callable[[Received], None]) -> None:
        """Declares the subscribers of a subscription; `receive` is called with every payload."""

    def declare_service(self, service: ServiceName, receive: Callable[[RawRequest], None]) -> None:
        """Declares the queryable of a service; `receive` is called with every request."""

    def action_keys(self, action: ActionName) -> Mapping[str, str]:
        """Returns the keys of an action's own name, by their field names in the list of interfaces."""

    def declare_action(self, action: ActionName, receive: Callable[[RawGoal], None]) -> None:
        """Declares the queryable on an action's own name, if there is one; `receive` is called with every goal."""

    def refused(self) -> Mapping[str, int]:
        """Returns the number of queries that are not requests, by the name of the service."""

    def close(self) -> None:
        """Makes every writer unmatched permanently; the session undeclares the other entities."""
