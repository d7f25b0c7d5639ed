"""The two forms of a payload, CDR and JSON: how they are marked, recognised and decoded."""

from dataclasses import dataclass
from typing import Generic, Literal, TypeVar

import zenoh

from mjplug.errors import RequestError, WireError, quoted
from mjplug_schemas.errors import CodecError
from mjplug_schemas.message import Message

M = TypeVar("M", bound=Message)

Form = Literal["cdr", "json"]

MAX_PAYLOAD = 1 << 20
"""Default limit of what is taken from others [bytes]: decoding is work that a stranger can ask for."""

MAX_JSON = 64 * 1024
"""Default limit of a JSON payload [bytes].

JSON is decoded in one call that holds Python's global lock, so physics waits for the end of it. What the call costs
grows with what the text contains: about 0.2 µs for a number, 1.3 µs for a field that the type does not have, 6 µs for
an object. The limits keep the worst text that is decoded at about 6 ms. CDR is decoded in small steps, between which
physics runs; the longest wait is for Python's garbage collector (46 ms with 8700 wrenches in 1 MiB).
"""

_BYTES_PER_OBJECT = 64
_BYTES_PER_FIELD = 16
"""A JSON payload may have one object for so many bytes of its limit, and one field for so many.

That is 1024 objects and 4096 fields by default. Objects are counted by `{` and fields by `:`, which takes 30 µs.
"""

MAX_TYPE_NAME = 255
"""The longest type name that Zenoh's encoding can carry [bytes]."""

TEXT = zenoh.Encoding.TEXT_PLAIN
"""What error replies are: one sentence."""

_FORMS: dict[str, Form] = {"application/cdr": "cdr", "application/json": "json", "text/json": "json"}
_UNSTATED = ("", "zenoh/bytes", "zenoh/string", "application/octet-stream", "text/plain")
"""What clients send that do not say, or that only say that it is bytes or text."""

_CDR_STARTS = (b"\0\0", b"\0\1")


class PayloadError(RequestError):
    """A payload that cannot be a message of the type; the sentence goes to the client, or to the log."""


@dataclass(frozen=True, slots=True)
class Limits:
    """How much is accepted in one message or request.

    Attributes:
        payload: The longest payload [bytes].
        json: The longest payload of JSON [bytes].
    """

    payload: int = MAX_PAYLOAD
    json: int = MAX_JSON

    def check_json(self, raw: bytes) -> None:
        """Checks JSON text before it is decoded.

        Raises:
            PayloadError: Decoding it would take too long; the sentence says to send CDR.
        """
        size = len(raw)
        if size > self.json:
            raise PayloadError(
                f"the JSON has {size} bytes; at most {self.json} are accepted (zenoh.max_json_bytes), send CDR"
            )
        for what, mark, least in (("objects", b"{", _BYTES_PER_OBJECT), ("fields", b":", _BYTES_PER_FIELD)):
            most, count = self.json // least, raw.count(mark)
            if count > most:
                raise PayloadError(
                    f"the JSON has {count} {what} (counted by '{mark.decode()}'); at most {most} are accepted, send CDR"
                )


DEFAULT_LIMITS = Limits()


def encoding_of(form: Form, type: type[Message]) -> zenoh.Encoding:
    """Returns the mark for a payload: `application/cdr;std_msgs/msg/String` or `application/json`.

    Raises:
        WireError: The name of the type is too long for Zenoh, which would panic when it sends it.
    """
    if form == "json":
        return zenoh.Encoding.APPLICATION_JSON
    if (size := len(type.TYPE.encode())) > MAX_TYPE_NAME:
        raise WireError(
            f"the name of the type {quoted(type.TYPE)} has {size} bytes; Zenoh can send names of {MAX_TYPE_NAME} bytes "
            "at most, so give the package or the type a shorter one"
        )
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
        unfit: Why it cannot be a message of the type, where this is known without decoding it; otherwise empty.
    """

    payload: zenoh.ZBytes | None
    encoding: zenoh.Encoding | None
    only: Form | None = None
    unfit: str = ""


class Decoder(Generic[M]):
    """Turns payloads into messages of one type.

    Args:
        type: The message's class.
        limits: How much is accepted.
        also: A second type name that senders may state, such as that of the service a request belongs to.
        empty: Whether no payload at all means a message with its initial values.
    """

    def __init__(self, type: type[M], limits: Limits = DEFAULT_LIMITS, also: str = "", empty: bool = False) -> None:
        self._type = type
        self._limits = limits
        self._names = {type.TYPE, also, ""}
        self._empty = empty

    def decode(self, received: Received) -> tuple[Form, M]:
        """Returns the form of a payload and the message in it.

        Raises:
            PayloadError: It is too long, of another type or encoding, or not a valid message.
        """
        if received.unfit:
            raise PayloadError(received.unfit)
        size = 0 if received.payload is None else len(received.payload)
        if size > self._limits.payload:
            raise PayloadError(
                f"the payload has {size} bytes; at most {self._limits.payload} are accepted (zenoh.max_payload_bytes)"
            )
        stated = self._stated(received)
        if size == 0 and self._empty:
            return stated or "json", self._type()
        raw = bytes(received.payload) if received.payload is not None else b""
        form = stated or _sniff(raw)
        if form == "json":
            self._limits.check_json(raw)
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
