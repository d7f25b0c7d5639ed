"""The two forms of a payload, CDR and JSON: their Zenoh encodings, detection and decoding."""

from dataclasses import dataclass
from typing import Generic, Literal, TypeVar

import zenoh

from mjplug.errors import RequestError, WireError, quoted
from mjplug_schemas.errors import CodecError
from mjplug_schemas.message import Message

M = TypeVar("M", bound=Message)

Form = Literal["cdr", "json"]

WrittenForm = Literal["cdr", "json", "bytes"]
"""The form of a writer's payloads; `bytes` are no ROS message."""

MAX_PAYLOAD = 1 << 20
"""Default maximum size of a received payload [bytes], because any client can make the server decode payloads."""

MAX_JSON = 64 * 1024
"""Default maximum size of a JSON payload [bytes].

JSON is decoded in one call that holds Python's global interpreter lock, so physics waits until it ends. The time
depends on the content: about 0.2 µs for a number, 1.3 µs for an unknown field, 6 µs for an object. With these limits,
the slowest accepted text takes about 6 ms. CDR is decoded in small steps, between which physics runs; the longest wait
is for Python's garbage collector (46 ms with 8700 wrenches in 1 MiB).
"""

_BYTES_PER_OBJECT = 64
_BYTES_PER_FIELD = 16
"""The maximum number of objects and of fields in a JSON payload is its size limit divided by these numbers [bytes].

By default that is 1024 objects and 4096 fields. Objects are counted by `{` and fields by `:`, which takes 30 µs.
"""

MAX_TYPE_NAME = 255
"""Maximum length of a type name in a Zenoh encoding [bytes]."""

TEXT = zenoh.Encoding.TEXT_PLAIN
"""Encoding of error replies."""

_FORMS: dict[str, Form] = {"application/cdr": "cdr", "application/json": "json", "text/json": "json"}
_UNSPECIFIC_ENCODINGS = ("", "zenoh/bytes", "zenoh/string", "application/octet-stream", "text/plain")
"""Encodings that do not state whether the payload is CDR or JSON."""

_CDR_STARTS = (b"\0\0", b"\0\1")


class PayloadError(RequestError):
    """A payload is not a valid message of the type. The text is sent to the client or logged."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Size limits of a received message or request.

    Attributes:
        payload: Maximum size of a payload [bytes].
        json: Maximum size of a JSON payload [bytes].
    """

    payload: int = MAX_PAYLOAD
    json: int = MAX_JSON

    def check_json(self, raw: bytes) -> None:
        """Checks JSON text before it is decoded.

        Raises:
            PayloadError: Decoding it would take too long.
        """
        size = len(raw)
        if size > self.json:
            raise PayloadError(
                f"the JSON has {size} bytes; at most {self.json} are accepted (zenoh.max_json_bytes), send CDR instead"
            )
        for what, mark, size_per_item in (("objects", b"{", _BYTES_PER_OBJECT), ("fields", b":", _BYTES_PER_FIELD)):
            max_count, count = self.json // size_per_item, raw.count(mark)
            if count > max_count:
                raise PayloadError(
                    f"the JSON has {count} {what} (counted by '{mark.decode()}'); "
                    f"at most {max_count} are accepted, send CDR instead"
                )


DEFAULT_LIMITS = Limits()


def encoding_of(form: Form, type: type[Message]) -> zenoh.Encoding:
    """Returns the Zenoh encoding of a payload: `application/cdr;std_msgs/msg/String` or `application/json`.

    Raises:
        WireError: The name of the type is too long; Zenoh would panic when sending it.
    """
    if form == "json":
        return zenoh.Encoding.APPLICATION_JSON
    if (size := len(type.TYPE.encode())) > MAX_TYPE_NAME:
        raise WireError(
            f"the type name {quoted(type.TYPE)} has {size} bytes; Zenoh accepts at most {MAX_TYPE_NAME}, "
            "so shorten the name of the package or of the type"
        )
    return zenoh.Encoding.APPLICATION_CDR.with_schema(type.TYPE)


def encode(message: Message, form: Form) -> bytes:
    """Encodes a message."""
    return message.to_cdr() if form == "cdr" else message.to_json()


@dataclass(slots=True)
class Received:
    """A received payload.

    Attributes:
        payload: The bytes; None for a request without payload.
        encoding: The encoding that the sender states.
        only: The only form that is accepted on this key; None if both are.
        mismatch: Why the payload cannot be a message of the type, if this is known without decoding; otherwise empty.
    """

    payload: zenoh.ZBytes | None
    encoding: zenoh.Encoding | None
    only: Form | None = None
    mismatch: str = ""


class Decoder(Generic[M]):
    """Decodes payloads to messages of one type.

    Args:
        type: The message's class.
        limits: Size limits.
        also: A second type name that senders may state, such as that of the service of a request.
        empty: Whether a missing payload means a message with default values.
        packed: Whether sequences of numbers in CDR become memoryviews; see `Message.from_cdr`.
    """

    def __init__(
        self,
        type: type[M],
        limits: Limits = DEFAULT_LIMITS,
        also: str = "",
        empty: bool = False,
        packed: bool = False,
    ) -> None:
        self._packed = packed
        self._type = type
        self._limits = limits
        self._names = {type.TYPE, also, ""}
        self._empty = empty
        # All texts of encodings that state a form, because comparing their parts takes longer.
        self._stated_by = {f"{text};{name}": form for text, form in _FORMS.items() for name in self._names if name}
        self._stated_by |= _FORMS

    def decode(self, received: Received) -> tuple[Form, M]:
        """Returns the form of a payload and the message in it.

        Raises:
            PayloadError: The payload is too large, has another type or encoding, or is not a valid message.
        """
        if received.mismatch:
            raise PayloadError(received.mismatch)
        size = 0 if received.payload is None else len(received.payload)
        if size > self._limits.payload:
            raise PayloadError(
                f"the payload has {size} bytes; at most {self._limits.payload} are accepted (zenoh.max_payload_bytes)"
            )
        stated = self._stated(received)
        if size == 0 and self._empty:
            return stated or "json", self._type()
        raw = received.payload.to_bytes() if received.payload is not None else b""
        form = stated or _sniff(raw)
        if form == "json":
            self._limits.check_json(raw)
        try:
            return form, self._type.from_cdr(raw, packed=self._packed) if form == "cdr" else self._type.from_json(raw)
        except CodecError as error:
            raise PayloadError(str(error)) from error

    def _stated(self, received: Received) -> Form | None:
        text = "" if received.encoding is None else str(received.encoding)
        stated = self._stated_by.get(text)
        if stated is not None and received.only in (None, stated):
            return stated
        name, _, schema = text.partition(";")
        form = received.only if name in _UNSPECIFIC_ENCODINGS else _FORMS.get(name)
        if form is None and name not in _UNSPECIFIC_ENCODINGS:
            raise PayloadError(f"the encoding is {name!r}; only application/cdr and application/json are accepted")
        if received.only not in (None, form):
            raise PayloadError(f"the encoding is {name!r}; only {received.only.upper()} is accepted on this key")
        if name in _FORMS and schema not in self._names:
            raise PayloadError(f"the encoding states the type {schema!r}; {self._type.TYPE!r} is expected")
        return form


def _sniff(raw: bytes) -> Form:
    if raw[:2] in _CDR_STARTS:
        return "cdr"
    if raw.lstrip()[:1] == b"{":
        return "json"
    what = f"starts with {raw[:4].hex(' ')}" if raw else "is empty"
    raise PayloadError(
        f"the payload {what}, so it is neither CDR nor a JSON object; "
        "state the encoding application/cdr or application/json"
    )
