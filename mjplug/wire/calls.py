"""The requests that wait for an answer: any thread may answer, once, and a stop refuses them all."""

from collections.abc import Mapping

from mjplug.wire.dialect import Inquiry
from mjplug.wire.encoding import Form, encode
from mjplug.wire.refusal import refusal
from mjplug.wire.rejections import Rejections
from mjplug.wire.replies import Replies
from mjplug_schemas.message import Message, Service

MAX_OPEN_CALLS = 4096
"""Default limit of requests that wait at the same time for services of one type."""


class WireCall:
    """A decoded request. Implements `mjplug.transport.Call`; any thread may answer, the first answer counts.

    Attributes:
        service: The service's class.

    Args:
        inquiry: The request as it came.
        request: The request.
        form: The form of the request, and so of the response.
        service: The service's class.
        open_calls: Where the call waits.
    """

    def __init__(
        self, inquiry: Inquiry, request: Message, form: Form, service: type[Service], open_calls: "OpenCalls"
    ) -> None:
        self.request = request
        self.parameters: Mapping[str, str] = inquiry.parameters
        self._form = form
        self.service = service
        self._open_calls = open_calls
        # Emptied by whoever answers: list.pop succeeds in one thread only.
        self._inquiry = [inquiry]

    def respond(self, response: Message) -> None:
        """Sends the response, unless the call has been answered.

        Raises:
            TypeError: It is not a response of this service; the call stays open.
        """
        if type(response) is not self.service.Response:
            raise TypeError(f"{self.service.TYPE} needs a {self.service.Response.TYPE}, not {type(response).__name__}")
        payload = encode(response, self._form)
        if inquiry := self._take():
            self._open_calls.replies.post(lambda: inquiry.reply(payload, self._form))

    def refuse(self, reason: str) -> None:
        """Answers that the request failed, unless the call has been answered."""
        if inquiry := self._take():
            self._open_calls.refuse(inquiry, self.service, reason, self._form)

    def _take(self) -> Inquiry | None:
        try:
            inquiry = self._inquiry.pop()
        except IndexError:
            return None
        self._open_calls.discard(self)
        return inquiry


class OpenCalls:
    """The calls of one session that wait for an answer. Thread-safe.

    Attributes:
        replies: Sends the answers.

    Args:
        limit: How many there may be to services of one type, so that a flood of one leaves the others in reach.
    """

    def __init__(self, limit: int = MAX_OPEN_CALLS) -> None:
        self._limit = limit
        self._calls: dict[type[Service], set[WireCall]] = {}
        self._closed: str | None = None
        self._untold = Rejections("a client got an empty response")
        self.replies = Replies()

    def __len__(self) -> int:
        return sum(map(len, tuple(self._calls.values())))

    def admit(self, call: WireCall) -> bool:
        """Keeps a call until it is answered, or refuses it and returns False."""
        calls = self._calls.setdefault(call.service, set())
        if self._closed is None and len(calls) >= self._limit:
            call.refuse(f"busy: {self._limit} requests are waiting already")
            return False
        calls.add(call)
        # Read after adding: a call that slips in while `close` runs is seen by one of the two.
        if self._closed is not None:
            call.refuse(self._closed)
            return False
        return True

    def discard(self, call: WireCall) -> None:
        """Forgets a call that has been answered."""
        self._calls.get(call.service, set()).discard(call)

    def refuse(self, inquiry: Inquiry, service: type[Service], reason: str, form: Form) -> None:
        """Answers a request that will not be carried out, in the words of its response type where it has them."""
        # What is no ROS string, such as an undecodable file name in an exception, must not keep the answer back.
        reason = reason.encode("utf-8", "replace").decode().replace("\0", "\N{REPLACEMENT CHARACTER}")
        response = refusal(service.Response, reason)
        if response is None and inquiry.needs_response:
            # An error reply would hang this client; a response that says nothing is the lesser evil.
            self._untold.add(f"{service.TYPE} cannot say that a request failed: {reason}")
            response = service.Response()
        if response is None:
            self.replies.post(lambda: inquiry.reply_error(reason))
        else:
            payload = encode(response, form)
            self.replies.post(lambda: inquiry.reply(payload, form))

    def refuse_all(self, reason: str) -> None:
        """Refuses every call that waits."""
        for call in [call for calls in tuple(self._calls.values()) for call in tuple(calls)]:
            call.refuse(reason)

    def close(self, reason: str) -> None:
        """Refuses every call, those to come too, and waits until the answers have left."""
        self._closed = reason
        self.refuse_all(reason)
        self.replies.close()
