"""What the nodes on the stand-in meet in: matches by name, type and quality of service, and passes bytes on."""

import threading
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, Listener
from typing import Any


@dataclass
class Endpoint:
    owner: Connection
    kind: str
    name: str
    type: str
    qos: tuple = (True, False, 10)
    kept: deque = field(default_factory=deque)

    def feeds(self, other: "Endpoint") -> bool:
        """Whether a publisher's messages reach a subscription."""
        reliable, latched, _ = self.qos
        compatible = (reliable or not other.qos[0]) and (latched or not other.qos[1])
        return other.kind == "subscription" and (self.name, self.type) == (other.name, other.type) and compatible


class Graph:
    def __init__(self, address):
        self.address = str(address)
        self._listener = Listener(self.address)
        self._lock = threading.RLock()
        self._endpoints: dict[str, Endpoint] = {}
        self._connections: list[Connection] = []
        self._calls: dict[int, tuple[str, Any]] = {}
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self):
        self._listener.close()
        with self._lock:
            for connection in self._connections:
                connection.close()

    def _accept(self):
        while True:
            try:
                connection = self._listener.accept()
            except OSError:
                return
            with self._lock:
                self._connections.append(connection)
                self._tell_topics()
            threading.Thread(target=self._read, args=(connection,), daemon=True).start()

    def _read(self, connection):
        while True:
            try:
                kind, entity, *data = connection.recv()
            except (EOFError, OSError, TypeError):
                break
            with self._lock:
                getattr(self, f"_{kind}")(connection, entity, *data)
        with self._lock:
            self._connections.remove(connection)
            for entity in [id for id, endpoint in self._endpoints.items() if endpoint.owner is connection]:
                self._gone(connection, entity)

    def _send(self, endpoint_id, kind, *data):
        endpoint = self._endpoints.get(endpoint_id)
        if endpoint is not None:
            self._write(endpoint.owner, (kind, endpoint_id, *data))

    def _write(self, connection, message):
        # If it has gone, its reader will see that.
        with suppress(OSError):
            connection.send(message)

    def _publisher(self, owner, id, name, type, *qos):
        self._endpoints[id] = Endpoint(owner, "publisher", name, type, qos, deque(maxlen=qos[2]))
        self._match(name)

    def _subscription(self, owner, id, name, type, *qos):
        subscription = self._endpoints[id] = Endpoint(owner, "subscription", name, type, qos)
        for publisher in self._all("publisher", name):
            if publisher.feeds(subscription) and qos[1]:
                for message in publisher.kept:
                    self._send(id, "message", message)
        self._match(name)

    def _service(self, owner, id, name, type):
        self._endpoints[id] = Endpoint(owner, "service", name, type)
        self._match(name)

    def _client(self, owner, id, name, type):
        self._endpoints[id] = Endpoint(owner, "client", name, type)
        self._match(name)

    def _gone(self, owner, id):
        self._match(self._endpoints.pop(id).name)

    def _publish(self, owner, id, message):
        publisher = self._endpoints.get(id)
        if publisher is None:
            return
        if publisher.qos[1]:
            publisher.kept.append(message)
        for other, endpoint in tuple(self._endpoints.items()):
            if publisher.feeds(endpoint):
                self._send(other, "message", message)

    def _request(self, owner, id, number, payload):
        client = self._endpoints[id]
        for other, service in self._endpoints.items():
            if (service.kind, service.name, service.type) == ("service", client.name, client.type):
                token = len(self._calls)
                self._calls[token] = id, number
                self._send(other, "request", token, payload)
                return

    def _response(self, owner, id, token, payload):
        client, number = self._calls[token]
        self._send(client, "response", number, payload)

    def _all(self, kind, name):
        return [endpoint for endpoint in self._endpoints.values() if (endpoint.kind, endpoint.name) == (kind, name)]

    def _match(self, name):
        subscriptions, services = self._all("subscription", name), self._all("service", name)
        for id, endpoint in tuple(self._endpoints.items()):
            if endpoint.name == name and endpoint.kind == "publisher":
                self._send(id, "matched", sum(map(endpoint.feeds, subscriptions)))
            elif endpoint.name == name and endpoint.kind == "client":
                self._send(id, "available", any(service.type == endpoint.type for service in services))
        self._tell_topics()

    def _tell_topics(self):
        topics: dict[str, set[str]] = {}
        for endpoint in self._endpoints.values():
            if endpoint.kind in ("publisher", "subscription"):
                topics.setdefault(endpoint.name, set()).add(endpoint.type)
        for connection in self._connections:
            self._write(connection, ("topics", "", topics))
