"""Steps a server over Zenoh. The client owns the steps of the server from its first step until it releases them."""

import threading
import uuid
from collections.abc import Callable
from typing import Any
from urllib.parse import quote

import zenoh

from mjplug.client import request as requests
from mjplug.client.driver import Driver
from mjplug.client.graph import Graph
from mjplug.client.timeouts import bounded
from mjplug.client.types import find
from mjplug.wire.discovery.format import ServiceInfo
from mjplug_schemas import names
from mjplug_schemas.message import Message, Service


class WireDriver(Driver):
    """Steps the server of a client.

    Args:
        client: The client.
        find_service: Returns the entry of a service, by its name.
    """

    def __init__(self, client: Graph, find_service: Callable[[str], ServiceInfo]) -> None:
        self._client = client
        self._find_service = find_service
        self._owner = uuid.uuid4().hex
        self._lock = threading.RLock()
        self._token: zenoh.LivelinessToken | None = None
        self._types: dict[str, tuple[str, type[Message]]] = {}

    def release(self) -> None:
        """Lets other clients step the server; does nothing if this one does not own it."""
        with self._lock:
            token, self._token = self._token, None
        if token is not None:
            # zenoh's stubs leave the return type open.
            token.undeclare()  # type: ignore[no-untyped-call]

    def _exchange(
        self, name: str, service: type[Service], request: Message, duration: float, timeout: float | None
    ) -> Any:
        client = self._client
        limit = requests.MARGIN + duration if timeout is None else bounded(timeout)
        info = self._find_service(name)
        self._own(info.server)
        response = requests.send(
            client.session, info, request, service, limit, parameters=f"owner={quote(self._owner)}", packed=True
        )
        requests.check(info, response)
        return response

    def _own(self, server: str) -> None:
        with self._lock:
            if self._token is None:
                key = f"{names.key(server)}/@step/{self._owner}"
                self._token = self._client.session.liveliness().declare_token(key)

    def _message_class(self, topic: str) -> tuple[str, type[Message]]:
        if topic not in self._types:
            self._types[topic] = self._client.resolve(topic), find(self._client.topic(topic).type)
        return self._types[topic]
