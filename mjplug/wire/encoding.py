"""The two forms of a payload, CDR and JSON: how they are marked, recognised and decoded."""

from dataclasses import dataclass
from typing import Generic, Literal, TypeVar

import zenoh

from mjplug.errors import RequestError
from mjplug_schemas.errors import CodecError
from mjplug_schemas.message import Message

M = TypeVar("M", bound=Message)

Form = Literal["cdr", "json"]

MAX_PAYLOAD = 1 << 20
"""Default limit of what is taken from others [bytes]: decoding is work that a stranger can ask for."""

MAX_JSON_OBJECTS = 10_000
"""Limit of the objects in one JSON payload.

JSON is decoded in one go, during which no other thread runs, physics neither. Numbers and text are quick, but an object
takes 2 to 4 µs, and 340,000 empty ones would fit into `MAX_PAYLOAD`.
"""

TEXT = zenoh.Encoding.TEXT_PLAIN
"""What error replies are: one sentence."""

_FORMS: dict[str, Form] = {"application/cdr": "cdr", "application/json": "json", "text/json": "json"}
_UNSTATED = ("", "zenoh/bytes", "zenoh/string", "application/octet-stream", "text/plain")
"""What clients send that do not say, or that only say that it is bytes or text."""

_CDR_STARTS = (b"\0\0", b"\0\1")


class PayloadError(RequestError):
    """A payload that cannot be a message of the type; the sentence goes to the client, or to the log."""


def encoding_of(form: Form, type: type[Message]) -> zenoh.Encoding:
    """Returns the mark for a payload: `application/cdr;std_msgs/msg/String` or `application/json`."""
    if form == "json":
        return zenoh.Encoding.APPLICATION_JSON
    return zenoh.Encoding.APPLICATION_CDR.with_schema(type.TYPE)


def encode(message: Message, form: Form) -> bytes:
    """Encodes a message."""
    return message.to_cdr() if form == "cdr" else message.to_json()


@dataclass(frozen=True, slots=True)
class Received:
    """A payload as it came.

    Attributes:
        payload: The bytes; None where a request has none.
        encoding: What the sender says they are.
        only: The one form that is possible where it came in; None where both are.
    """

    payload: zenoh.ZBytes | None
    encoding: zenoh.Encoding | None
    only: Form | None = None


class Decoder(Generic[M]):
    """Turns payloads into messages of one type.

    Args:
        type: The message's class.
        limit: The longest payload to look at [bytes].
        also: A second type name that senders may state, such as that of the service a request belongs to.
        empty: Whether no payload at all means a message with its initial values.
    """

    def __init__(self, type: type[M], limit: int = MAX_PAYLOAD, also: str = "", empty: bool = False) -> None:
        self._type = type
        self._limit = limit
        self._names = {type.TYPE, also, ""}
        self._empty = empty

    def decode(self, received: Received) -> tuple[Form, M]:
        """Returns the form of a payload and the message in it.

        Raises:
            PayloadError: It is too long, of another type or encoding, or not a valid message.
        """
        size = 0 if received.payload is None else len(received.payload)
        if size > self._limit:
            raise PayloadError(f"the payload has {size} bytes; at most {self._limit} are accepted")
        stated = self._stated(received)
        if size == 0 and self._empty:
            return stated or "json", self._type()
        raw = bytes(received.payload) if received.payload is not None else b""
        form = stated or _sniff(raw)
        if form == "json" and (objects := raw.count(b"{")) > MAX_JSON_OBJECTS:
            raise PayloadError(
                f"the JSON has {objects} objects (counted by '{{'); at most {MAX_JSON_OBJECTS} are accepted, send CDR"
            )
        try:
            return form, self._type.from_cdr(raw) if form == "cdr" else self._type.from_json(raw)
        except CodecError as error:
            raise PayloadError(str(error)) from error

    def _stated(self, received: Received) -> Form | None:
        name, _, schema = ("" if received.encoding is None else str(received.encoding)).partition(";")
        form = received.only if name in _UNSTATED else _FORMS.get(name)
        if form is None and name not in _UNSTATED:
            raise PayloadError(f"the encoding is {name!r}; application/cdr and application/json are accepted")
        if received.only not in (None, form):
            raise PayloadError(f"the encoding is {name!r}; only {received.only.upper()} is accepted on this key")
        if name in _FORMS and schema not in self._names:
            raise PayloadError(f"the encoding says {schema!r}; {self._type.TYPE!r} is expected")
        return form


def _sniff(raw: bytes) -> Form:
    if raw[:2] in _CDR_STARTS:
        return "cdr"
    if raw.lstrip()[:1] == b"{":
        return "json"
    what = f"starts with {raw[:4].hex(' ')}" if raw else "is empty"
    raise PayloadError(f"the payload {what}, which is neither CDR nor a JSON object, and no encoding is stated")
