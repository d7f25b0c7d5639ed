"""The plain dialect for any Zenoh client: the key is the ROS name without its leading slash.

A topic is published as CDR on `<key>` and as JSON on `<key>/@json`. `@json` is a verbatim chunk, which `**` does not
match, so a subscriber to `**` gets each message once, and a subscriber to `**/@json` gets all JSON. The server also
subscribes to both keys: it accepts CDR or JSON on `<key>`, and JSON on `<key>/@json`. Use the latter with
zenoh-bridge-ros2dds, which passes all payloads on `<key>` to DDS as CDR.

A service is a queryable on `<key>` that replies to CDR with CDR and to JSON with JSON. It accepts only queries on
exactly its key, so that a `get('**')` does not call services. It is not declared complete, because other programs may
serve the same key.

An action is three services and two topics below `<key>/_action/`, and a queryable on `<key>` with several replies.
"""

from collections.abc import Callable, Mapping
from typing import Any
from urllib.parse import unquote

import zenoh

from mjplug.contracts.actions import ActionName
from mjplug.contracts.transport import ServiceName, Topic
from mjplug.wire.callbacks import callback
from mjplug.wire.dialect import KeyWriter, RawGoal, RawRequest
from mjplug.wire.encoding import TEXT, Form, Received, encoding_of
from mjplug.wire.key_subscriber import declare_key_subscriber
from mjplug.wire.key_writers import LatchedWriter, LiveWriter
from mjplug.wire.origin import Attachments, Now, host_id, no_time
from mjplug_schemas import names
from mjplug_schemas.message import Message

_BRIDGE_MARK = b"rqh"
_BRIDGE_ATTACHMENT_SIZE = 20
"""Attachment of requests from zenoh-bridge-ros2dds: these letters, a guid (8 bytes), a sequence number (8) and the byte
order (1)."""

_FORMS: tuple[Form, ...] = ("cdr", "json")


def key_of(name: str, form: Form = "cdr") -> str:
    """Returns the key of a full ROS name."""
    key = names.key(name)
    return f"{key}/@json" if form == "json" else key


class PlainDialect:
    """Implements `mjplug.wire.dialect.Dialect` on one session.

    Args:
        session: The session.
        name: The server's full name, such as `/robot1/mjplug`.
        now: Returns the simulated time and the epoch, for the attachments of messages.
    """

    def __init__(self, session: zenoh.Session, name: str = "", now: Now = no_time) -> None:
        self._session = session
        self._host = host_id(session, name)
        self._now = now
        self._writers: list[LiveWriter | LatchedWriter] = []
        self._declared: list[object] = []

    def topic_keys(self, topic: Topic[Any]) -> Mapping[str, str]:
        """Returns the CDR key and the JSON key."""
        return {"key": key_of(topic.name), "json_key": key_of(topic.name, "json")}

    def service_keys(self, service: ServiceName) -> Mapping[str, str]:
        """Returns the key."""
        return {"key": key_of(service.name)}

    def declare_writers(self, topic: Topic[Any], on_matched: Callable[[], None]) -> list[KeyWriter]:
        """Declares the two publishers of a topic."""
        writers = [self._declare_writer(topic, form, on_matched) for form in _FORMS]
        self._writers += writers
        return [*writers]

    def declare_subscribers(self, topic: Topic[Any], receive: Callable[[Received], None]) -> None:
        """Declares the two subscribers of a topic."""
        for form in _FORMS:
            only: Form | None = "json" if form == "json" else None
            handler = callback(_sample_handler(receive, only))
            key = key_of(topic.name, form)
            self._declared.append(declare_key_subscriber(self._session, key, handler, topic.qos))

    def declare_service(self, service: ServiceName, receive: Callable[[RawRequest], None]) -> None:
        """Declares the queryable of a service."""
        self._declare_queryable(key_of(service.name), "a service", service.type.Response, receive)

    def action_keys(self, action: ActionName) -> Mapping[str, str]:
        """Returns the key."""
        return {"key": key_of(action.name)}

    def declare_action(self, action: ActionName, receive: Callable[[RawGoal], None]) -> None:
        """Declares the queryable on the action's own name."""
        self._declare_queryable(key_of(action.name), "an action", action.type.GetResult.Response, receive)

    def refused(self) -> Mapping[str, int]:
        """Returns an empty mapping; every query on a service's key is treated as a request."""
        return {}

    def close(self) -> None:
        """Makes every writer unmatched permanently."""
        for writer in self._writers:
            writer.close()

    def _declare_queryable(
        self, key: str, what: str, response: type[Message], receive: "Callable[[PlainRequest], None]"
    ) -> None:
        encodings = {form: encoding_of(form, response) for form in _FORMS}

        def handle(query: zenoh.Query) -> None:
            if str(query.key_expr) == key:
                receive(PlainRequest(query, key, encodings))
            else:
                with query:
                    query.reply_err(f"{key} is {what}; query exactly this key to call it".encode(), encoding=TEXT)

        self._declared.append(self._session.declare_queryable(key, callback(handle), complete=False))

    def _declare_writer(
        self, topic: Topic[Any], form: Form, on_matched: Callable[[], None]
    ) -> LiveWriter | LatchedWriter:
        key, encoding = key_of(topic.name, form), encoding_of(form, topic.type)
        attachments = Attachments(self._host, self._now)
        if topic.qos.durability == "transient_local":
            return LatchedWriter(self._session, key, form, encoding, topic.qos, attachments)
        return LiveWriter(self._session, key, form, encoding, topic.qos, on_matched, attachments)


class PlainRequest:
    """A query on a plain key. Implements `mjplug.wire.dialect.RawGoal`, and so `RawRequest`."""

    def __init__(self, query: zenoh.Query, key: str, encodings: Mapping[Form, zenoh.Encoding]) -> None:
        payload, attachment, text = query.payload, query.attachment, str(query.parameters)
        self.received = Received(payload, query.encoding)
        self.parameters = parsed(text)
        self.needs_response = attachment is not None and _from_bridge(attachment)
        self.size = (len(payload) if payload is not None else 0) + len(text)
        if attachment is not None:
            self.size += len(attachment)
        self._query = query
        self._key = key
        self._encodings = encodings

    def reply(self, payload: bytes, form: Form) -> None:
        """Sends the response."""
        with self._query as query:
            query.reply(self._key, payload, encoding=self._encodings[form])

    def reply_error(self, sentence: str) -> None:
        """Sends an error reply with one sentence as `text/plain`."""
        with self._query as query:
            query.reply_err(sentence.encode(), encoding=TEXT)

    def reply_part(self, payload: bytes, encoding: zenoh.Encoding) -> None:
        """Sends one of several replies."""
        self._query.reply(self._key, payload, encoding=encoding)

    def end(self) -> None:
        """Ends the request."""
        # zenoh's stubs leave the return type open.
        self._query.drop()  # type: ignore[no-untyped-call]


def parameters(query: zenoh.Query) -> Mapping[str, str]:
    """Returns the parameters of a query's selector, percent-decoded."""
    return parsed(str(query.parameters))


def parsed(text: str) -> Mapping[str, str]:
    """Returns the parameters in a text, percent-decoded."""
    if not text:
        return {}
    pairs = (pair.partition("=") for pair in text.split(";") if pair)
    return {unquote(name): unquote(value) for name, _, value in pairs}


def _sample_handler(receive: Callable[[Received], None], only: Form | None) -> Callable[[zenoh.Sample], None]:
    def handle(sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.PUT:
            receive(Received(sample.payload, sample.encoding, only))

    return handle


def _from_bridge(attachment: zenoh.ZBytes) -> bool:
    return len(attachment) == _BRIDGE_ATTACHMENT_SIZE and bytes(attachment).startswith(_BRIDGE_MARK)
