"""The services of a server, callable from Foxglove's panel "Service call"."""

from collections.abc import Callable

import foxglove
import zenoh
from foxglove.websocket import ServiceRequest

from mjplug.recorder.sources import ServiceSource
from mjplug.wire.discovery.announced import AT_ONCE

_TIMEOUT = 60.0
"""Timeout of a call [s]; a wrench may take as long as it lasts."""


def service_of(session: zenoh.Session, source: ServiceSource) -> foxglove.Service:
    """Returns a service whose calls are sent to its server."""
    return foxglove.Service(
        source.name,
        schema=foxglove.ServiceSchema(
            source.type.replace("/srv/", "/"),
            request=_schema(f"{source.type}_Request", source.request),
            response=_schema(f"{source.type}_Response", source.response),
        ),
        handler=_handler(session, source),
    )


def _schema(name: str, text: str) -> foxglove.MessageSchema:
    schema = foxglove.Schema(name=name, encoding="ros2msg", data=text.encode())
    return foxglove.MessageSchema(encoding="cdr", schema=schema)


def _handler(session: zenoh.Session, source: ServiceSource) -> Callable[[ServiceRequest], bytes]:
    def handle(request: ServiceRequest) -> bytes:
        cdr = zenoh.Encoding.APPLICATION_CDR
        for reply in session.get(
            source.key, payload=request.payload, encoding=cdr, consolidation=AT_ONCE, timeout=_TIMEOUT
        ):
            if reply.ok is not None:
                return reply.ok.payload.to_bytes()
            assert reply.err is not None
            # The SDK sends its text to the client.
            raise RuntimeError(reply.err.payload.to_string())
        raise RuntimeError(f"{source.server} does not answer; it may have stopped")

    return handle
