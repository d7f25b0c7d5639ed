"""A service of the server: decodes, validates and delivers its requests. Runs on Zenoh's threads."""

import logging
from collections.abc import Callable

from mjplug.contracts.transport import Call, ServiceName
from mjplug.wire.calls import OpenCalls, WireCall
from mjplug.wire.dialect import RawRequest
from mjplug.wire.encoding import DEFAULT_LIMITS, Decoder, Limits, PayloadError
from mjplug.wire.rejections import Rejections

_LOG = logging.getLogger(__name__)


class ServiceServer:
    """Decodes the requests to one service. Runs on Zenoh's threads.

    Attributes:
        rejections: Counts invalid requests.
        busy: Counts valid requests that were refused because too many were waiting.

    Args:
        service: The service.
        deliver: Called with each call; it may only enqueue.
        open_calls: The session's open calls.
        limits: Size limits of requests.
    """

    def __init__(
        self,
        service: ServiceName,
        deliver: Callable[[Call], None],
        open_calls: OpenCalls,
        limits: Limits = DEFAULT_LIMITS,
    ) -> None:
        self.rejections = Rejections(f"service {service.name}: a request was refused")
        self.busy = Rejections(f"service {service.name}: a request was refused")
        self._service = service
        self._deliver = deliver
        self._open_calls = open_calls
        self._decoder = Decoder(service.type.Request, limits, service.type.TYPE, empty=True, packed=service.packed)

    def receive(self, raw: RawRequest) -> None:
        """Handles one request. Never raises, because it runs on Zenoh's thread."""
        try:
            form, request = self._decoder.decode(raw.received)
        except PayloadError as error:
            self.rejections.add(str(error))
            reason = str(error)
            if raw.needs_response:
                self._open_calls.refuse(raw, self._service.type, reason, "cdr")
            else:
                self._open_calls.replies.post(lambda: raw.reply_error(reason))
            return
        call = WireCall(raw, request, form, self._service.type, self._open_calls)
        admission = self._open_calls.admit(call)
        if admission == "busy":
            self.busy.add("too many requests are waiting")
        if admission != "admitted":
            return
        try:
            self._deliver(call)
        except Exception:
            _LOG.exception("service %s: delivering a request failed", self._service.name)
            call.refuse("internal error: delivering the request failed; see the server's log")
