"""Requests that wait for their response. Any thread may respond, once; when the server stops, all are refused."""

import threading
from collections.abc import Mapping
from typing import Literal, Protocol

from mjplug.contracts.cdr_frame import CdrFrame
from mjplug.log import ros_string
from mjplug.wire.dialect import RawRequest
from mjplug.wire.encoding import Form, encode
from mjplug.wire.refusal import refusal
from mjplug.wire.rejections import Rejections
from mjplug.wire.replies import Replies
from mjplug_schemas.message import Message, Service

MAX_OPEN_CALLS = 4096
"""Default maximum number of requests that wait at the same time, for all services of one type."""

MAX_OPEN_BYTES = 32 << 20
"""Default maximum size of all waiting requests [bytes].

Zenoh keeps the payload and the attachment of a request until it is answered.
"""

MAX_SMALL_REQUEST = 4096
"""Maximum size of a request that does not count towards `MAX_OPEN_BYTES` [bytes], so that large requests cannot block
small ones."""

Admission = Literal["admitted", "busy", "closed"]


class WireCall:
    """A decoded request. Implements `mjplug.contracts.transport.Call`.

    Any thread may respond; the first response is sent and later ones are ignored.

    Attributes:
        service: The service's class.
        size: Size of the data that Zenoh keeps until the request is answered [bytes].
        form: The form of the request and of the response.

    Args:
        raw: The encoded request.
        request: The decoded request.
        form: The form of the request and of the response.
        service: The service's class.
        open_calls: The open calls of the session.
    """

    def __init__(
        self, raw: RawRequest, request: Message, form: Form, service: type[Service], open_calls: "OpenCalls"
    ) -> None:
        self.request = request
        self.size = raw.size
        self.parameters: Mapping[str, str] = raw.parameters
        self.form = form
        self.service = service
        self._open_calls = open_calls
        # The responding thread takes the request out; list.pop succeeds in one thread only.
        self._raw = [raw]

    def respond(self, response: Message) -> None:
        """Sends the response, unless the call has been answered.

        Raises:
            TypeError: The response is not of this service's type; the call stays open.
        """
        if type(response) is not self.service.Response:
            raise TypeError(
                f"the response of {self.service.TYPE} must be a {self.service.Response.TYPE}, "
                f"not {type(response).__name__}"
            )
        if self._raw:
            self._send(encode(response, self.form))

    def respond_frame(self, frame: CdrFrame) -> None:
        """Sends the response in a frame, unless the call has been answered."""
        payload = frame.payload()
        if self.form != "cdr":
            payload = encode(frame.type.from_cdr(payload), self.form)
        self._send(payload)

    def refuse(self, reason: str) -> None:
        """Reports that the request failed, unless the call has been answered."""
        if raw := self._take():
            self._open_calls.refuse(raw, self.service, reason, self.form)

    def _send(self, payload: bytes) -> None:
        if raw := self._take():
            self._open_calls.replies.post(lambda: raw.reply(payload, self.form), len(payload))

    def _take(self) -> RawRequest | None:
        try:
            raw = self._raw.pop()
        except IndexError:
            return None
        self._open_calls.discard(self)
        return raw


class OpenCall(Protocol):
    """A request that may be kept until it is answered."""

    @property
    def service(self) -> type[Service]:
        """The service's class."""

    @property
    def size(self) -> int:
        """Size of the data that Zenoh keeps until the request is answered [bytes]."""

    def refuse(self, reason: str) -> None:
        """Reports that the request failed, unless it has been answered."""


class OpenCalls:
    """The calls of one session that wait for their response. Thread-safe.

    Attributes:
        replies: Sends the responses.

    Args:
        limit: Maximum number of calls to services of one type, so that a flood of one type does not block the others.
        max_bytes: Maximum total size of the calls [bytes], without those of at most `MAX_SMALL_REQUEST` bytes.
    """

    def __init__(self, limit: int = MAX_OPEN_CALLS, max_bytes: int = MAX_OPEN_BYTES) -> None:
        self._limit = limit
        self._max_bytes = max_bytes
        self._bytes = 0
        # Held while any thread adds or removes a call; never while a response is sent.
        self._lock = threading.Lock()
        self._calls: dict[type[Service], set[OpenCall]] = {}
        self._closed: str | None = None
        self._empty_responses = Rejections("a client got an empty response")
        self.replies = Replies()

    def __len__(self) -> int:
        return sum(map(len, tuple(self._calls.values())))

    @property
    def bytes(self) -> int:
        """Total size of the waiting requests [bytes], without those of at most `MAX_SMALL_REQUEST` bytes."""
        return self._bytes

    def admit(self, call: OpenCall) -> Admission:
        """Keeps a call until it is answered, or refuses it; returns which."""
        large = call.size if call.size > MAX_SMALL_REQUEST else 0
        with self._lock:
            calls = self._calls.setdefault(call.service, set())
            closed = self._closed
            if closed is not None:
                busy = ""
            elif len(calls) >= self._limit:
                busy = f"busy: {self._limit} requests are waiting, which is the maximum; try again later"
            elif large and self._bytes + large > self._max_bytes:
                busy = (
                    f"busy: the waiting requests have {self._bytes} bytes; at most {self._max_bytes} are accepted, "
                    "try again later"
                )
            else:
                calls.add(call)
                self._bytes += large
                return "admitted"
        call.refuse(busy if closed is None else closed)
        return "busy" if closed is None else "closed"

    def discard(self, call: OpenCall) -> None:
        """Removes a call that has been answered."""
        with self._lock:
            calls = self._calls.get(call.service, set())
            if call in calls:
                calls.discard(call)
                self._bytes -= call.size if call.size > MAX_SMALL_REQUEST else 0

    def refuse(self, raw: RawRequest, service: type[Service], reason: str, form: Form) -> None:
        """Refuses a request: with a response if its type has a field `success`, otherwise with an error reply."""
        # A text that is not a valid ROS string, such as an undecodable file name, must not prevent the reply.
        response = refusal(service.Response, reason := ros_string(reason))
        if response is None and raw.needs_response:
            # This client would wait for ever after an error reply, so an empty response is the better choice.
            self._empty_responses.add(f"{service.TYPE} has no field for a failure: {reason}")
            response = service.Response()
        if response is None:
            self.replies.post(lambda: raw.reply_error(reason))
        else:
            payload = encode(response, form)
            self.replies.post(lambda: raw.reply(payload, form), len(payload))

    def refuse_all(self, reason: str) -> None:
        """Refuses every waiting call."""
        with self._lock:
            waiting = [call for calls in self._calls.values() for call in calls]
        for call in waiting:
            call.refuse(reason)

    def close(self, reason: str) -> None:
        """Refuses every waiting call and every later call, and waits until the responses are sent."""
        with self._lock:
            self._closed = reason
        self.refuse_all(reason)
        self.replies.close()
