"""The server's table of contents: a queryable on `<namespace>/<node_name>/interfaces` that answers with JSON.

`interfaces` alone lists names, types, hashes and keys; `interfaces?schema=true` adds the definition text and the JSON
Schema of each type. Answered on Zenoh's thread.

A subscriber to the same key gets an empty message after each change. It has to ask for the list itself, since a change
may happen on the physics thread, which has no time to write lists.
"""

import json
import logging
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from functools import cache
from typing import Any, Literal

import zenoh

from mjplug.contracts.transport import QoS, ServiceName, Topic
from mjplug.wire.callbacks import callback
from mjplug.wire.discovery.format import interfaces_key
from mjplug.wire.encoding import TEXT
from mjplug.wire.plain import parameters
from mjplug_schemas.definition import definition
from mjplug_schemas.message import Message
from mjplug_schemas.rihs01 import type_hash

_LOG = logging.getLogger(__name__)

Direction = Literal["published", "subscribed"]


@dataclass(frozen=True, slots=True)
class TopicEntry:
    """A topic of the server, what the server does with it, and its keys by their names in the listing."""

    topic: Topic[Any]
    direction: Direction
    keys: Mapping[str, str]

    def describe(self) -> dict[str, Any]:
        """Returns what the listing says."""
        qos: QoS = self.topic.qos
        return {
            "name": self.topic.name,
            "direction": self.direction,
            **self.keys,
            "type": self.topic.type.TYPE,
            "hash": _hash(self.topic.type),
            "qos": asdict(qos),
        }


@dataclass(frozen=True, slots=True)
class ServiceEntry:
    """A service of the server, and its keys by their names in the listing."""

    service: ServiceName
    keys: Mapping[str, str]

    def describe(self) -> dict[str, Any]:
        """Returns what the listing says."""
        return {
            "name": self.service.name,
            **self.keys,
            "type": self.service.type.TYPE,
            "hash": _hash(self.service.type),
        }


@dataclass(frozen=True, slots=True)
class Listing:
    """Everything that the server offers at one moment.

    Immutable, since Zenoh's threads read it while the server declares more.

    Attributes:
        name: The server's full name.
        version: mjplug's version.
        endpoint: Where clients connect.
        topics: Its topics.
        services: Its services.
    """

    name: str
    version: str
    endpoint: str
    topics: tuple[TopicEntry, ...] = ()
    services: tuple[ServiceEntry, ...] = field(default=())

    def to_json(self, schema: bool = False) -> bytes:
        """Returns the listing as JSON text."""
        told: dict[str, Any] = {
            "name": self.name,
            "version": self.version,
            "endpoint": self.endpoint,
            "topics": [entry.describe() for entry in self.topics],
            "services": [entry.describe() for entry in self.services],
        }
        if schema:
            types: list[Any] = [entry.topic.type for entry in self.topics] + [
                entry.service.type for entry in self.services
            ]
            told["types"] = {type.TYPE: _schema(type) for type in types}
        return json.dumps(told).encode()


class InterfacesQueryable:
    """Answers with the listing of the moment, and tells subscribers when there is another.

    With the parameter `subscribed=<key>` it answers, in place of the listing, whether the publisher of that key knows
    of a subscriber. The publisher knows of all whose declaration came before this query.

    Args:
        session: The session.
        listing: The first listing.
        refresh: Brings the publishers of a key up to date; returns whether one of them knows of a subscriber.
    """

    def __init__(self, session: zenoh.Session, listing: Listing, refresh: Callable[[str], bool]) -> None:
        self._refresh = refresh
        self._listing = listing
        self._key = interfaces_key(listing.name)
        self._news = session.declare_publisher(self._key, congestion_control=zenoh.CongestionControl.DROP)
        self._queryable = session.declare_queryable(self._key, callback(self._answer))

    @property
    def listing(self) -> Listing:
        """The newest listing; assign to change it."""
        return self._listing

    @listing.setter
    def listing(self, listing: Listing) -> None:
        self._listing = listing
        self._news.put(b"")

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            try:
                asked = parameters(query)
                if (key := asked.get("subscribed")) is not None:
                    payload = json.dumps({"key": key, "subscribed": self._refresh(key)}).encode()
                else:
                    payload = self.listing.to_json(asked.get("schema", "false") == "true")
            except Exception as error:
                _LOG.exception("the listing of interfaces could not be made")
                query.reply_err(f"the listing could not be made: {error}".encode(), encoding=TEXT)
            else:
                query.reply(self._key, payload, encoding=zenoh.Encoding.APPLICATION_JSON)


def _hash(interface: Any) -> str:
    # Any: mypy does not take a class for a hashable argument of a cached function.
    return type_hash(interface)


@cache
def _schema(type: Any) -> dict[str, Any]:
    if issubclass(type, Message):
        return {"definition": definition(type), "schema": type.model_json_schema()}
    return {
        "definition": definition(type),
        "request": type.Request.model_json_schema(),
        "response": type.Response.model_json_schema(),
    }
