"""The requests that wait for an answer: any thread may answer, once, and a stop refuses them all."""

import threading
from collections.abc import Mapping
from typing import Literal

from mjplug.log import ros_string
from mjplug.wire.dialect import RawRequest
from mjplug.wire.encoding import Form, encode
from mjplug.wire.refusal import refusal
from mjplug.wire.rejections import Rejections
from mjplug.wire.replies import Replies
from mjplug_schemas.message import Message, Service

MAX_OPEN_CALLS = 4096
"""Default limit of requests that wait at the same time for services of one type."""

MAX_OPEN_BYTES = 32 << 20
"""Default limit of the bytes of all requests that wait at the same time.

Zenoh keeps a request's payload and attachment until it is answered.
"""

SMALL = 4096
"""Requests up to this size [bytes] are admitted whatever the larger ones take, so that those cannot keep them out."""

Admission = Literal["admitted", "busy", "closed"]


class WireCall:
    """A decoded request. Implements `mjplug.contracts.transport.Call`; any thread may answer, the first answer counts.

    Attributes:
        service: The service's class.
        size: What Zenoh keeps of the request until it is answered [bytes].

    Args:
        raw: The request as it came.
        request: The request.
        form: The form of the request, and so of the response.
        service: The service's class.
        open_calls: Where the call waits.
    """

    def __init__(
        self, raw: RawRequest, request: Message, form: Form, service: type[Service], open_calls: "OpenCalls"
    ) -> None:
        self.request = request
        self.size = raw.size
        self.parameters: Mapping[str, str] = raw.parameters
        self._form = form
        self.service = service
        self._open_calls = open_calls
        # Emptied by whoever answers: list.pop succeeds in one thread only.
        self._raw = [raw]

    def respond(self, response: Message) -> None:
        """Sends the response, unless the call has been answered.

        Raises:
            TypeError: It is not a response of this service; the call stays open.
        """
        if type(response) is not self.service.Response:
            raise TypeError(f"{self.service.TYPE} needs a {self.service.Response.TYPE}, not {type(response).__name__}")
        payload = encode(response, self._form)
        if raw := self._take():
            self._open_calls.replies.post(lambda: raw.reply(payload, self._form))

    def refuse(self, reason: str) -> None:
        """Answers that the request failed, unless the call has been answered."""
        if raw := self._take():
            self._open_calls.refuse(raw, self.service, reason, self._form)

    def _take(self) -> RawRequest | None:
        try:
            raw = self._raw.pop()
        except IndexError:
            return None
        self._open_calls.discard(self)
        return raw


class OpenCalls:
    """The calls of one session that wait for an answer. Thread-safe.

    Attributes:
        replies: Sends the answers.

    Args:
        limit: How many there may be to services of one type, so that a flood of one leaves the others in reach.
        most_bytes: How many bytes all of them may have, those of at most `SMALL` bytes aside.
    """

    def __init__(self, limit: int = MAX_OPEN_CALLS, most_bytes: int = MAX_OPEN_BYTES) -> None:
        self._limit = limit
        self._most_bytes = most_bytes
        self._bytes = 0
        # Held while calls are added and removed, by any thread; never while one is answered.
        self._lock = threading.Lock()
        self._calls: dict[type[Service], set[WireCall]] = {}
        self._closed: str | None = None
        self._untold = Rejections("a client got an empty response")
        self.replies = Replies()

    def __len__(self) -> int:
        return sum(map(len, tuple(self._calls.values())))

    @property
    def bytes(self) -> int:
        """What Zenoh keeps of the requests that wait [bytes], those of at most `SMALL` bytes aside."""
        return self._bytes

    def admit(self, call: WireCall) -> Admission:
        """Keeps a call until it is answered, or refuses it and says why."""
        large = call.size if call.size > SMALL else 0
        with self._lock:
            calls = self._calls.setdefault(call.service, set())
            closed = self._closed
            if closed is not None:
                busy = ""
            elif len(calls) >= self._limit:
                busy = f"busy: {self._limit} requests are waiting already"
            elif large and self._bytes + large > self._most_bytes:
                busy = (
                    f"busy: the requests that wait have {self._bytes} bytes already, at most {self._most_bytes} are "
                    "accepted; send it again when they have been answered"
                )
            else:
                calls.add(call)
                self._bytes += large
                return "admitted"
        call.refuse(busy if closed is None else closed)
        return "busy" if closed is None else "closed"

    def discard(self, call: WireCall) -> None:
        """Forgets a call that has been answered."""
        with self._lock:
            calls = self._calls.get(call.service, set())
            if call in calls:
                calls.discard(call)
                self._bytes -= call.size if call.size > SMALL else 0

    def refuse(self, raw: RawRequest, service: type[Service], reason: str, form: Form) -> None:
        """Answers a request that will not be carried out, in the words of its response type where it has them."""
        # What is no ROS string, such as an undecodable file name in an exception, must not keep the answer back.
        response = refusal(service.Response, reason := ros_string(reason))
        if response is None and raw.needs_response:
            # An error reply would hang this client; a response that says nothing is the lesser evil.
            self._untold.add(f"{service.TYPE} cannot say that a request failed: {reason}")
            response = service.Response()
        if response is None:
            self.replies.post(lambda: raw.reply_error(reason))
        else:
            payload = encode(response, form)
            self.replies.post(lambda: raw.reply(payload, form))

    def refuse_all(self, reason: str) -> None:
        """Refuses every call that waits."""
        with self._lock:
            waiting = [call for calls in self._calls.values() for call in calls]
        for call in waiting:
            call.refuse(reason)

    def close(self, reason: str) -> None:
        """Refuses every call, those to come too, and waits until the answers have left."""
        with self._lock:
            self._closed = reason
        self.refuse_all(reason)
        self.replies.close()
