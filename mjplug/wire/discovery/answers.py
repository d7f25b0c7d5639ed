"""The list of a server's interfaces: a queryable on `<namespace>/<node_name>/interfaces` that replies with JSON.

`interfaces` lists names, types, hashes and keys; `interfaces?schema=true` adds the definition text and the JSON Schema
of each type. Zenoh's thread builds the reply.

A subscriber to the same key gets an empty message after each change and then queries the list. The message does not
contain the list, because a change may happen on the physics thread, where building the list would take too long.
"""

import json
import logging
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, field
from functools import cache
from typing import Any, Literal

import zenoh

from mjplug.contracts.actions import ActionName
from mjplug.contracts.transport import QoS, ServiceName, Topic
from mjplug.wire.callbacks import callback
from mjplug.wire.discovery.announced import interfaces_key
from mjplug.wire.encoding import TEXT
from mjplug.wire.plain import parameters
from mjplug_schemas.action import Action
from mjplug_schemas.definition import definition
from mjplug_schemas.idl import Primitive
from mjplug_schemas.message import Message
from mjplug_schemas.rihs01 import type_hash
from mjplug_schemas.shape import fields

_LOG = logging.getLogger(__name__)

Direction = Literal["published", "subscribed"]


@dataclass(frozen=True, slots=True)
class TopicEntry:
    """A topic of the server.

    Attributes:
        topic: The topic.
        direction: Whether the server publishes it or subscribes to it.
        keys: Its keys, by their field names in the list.
    """

    topic: Topic[Any]
    direction: Direction
    keys: Mapping[str, str]

    def describe(self) -> dict[str, Any]:
        """Returns the entry of the list."""
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
    """A service of the server.

    Attributes:
        service: The service.
        keys: Its keys, by their field names in the list.
    """

    service: ServiceName
    keys: Mapping[str, str]

    def describe(self) -> dict[str, Any]:
        """Returns the entry of the list."""
        return {
            "name": self.service.name,
            **self.keys,
            "type": self.service.type.TYPE,
            "hash": _hash(self.service.type),
        }


@dataclass(frozen=True, slots=True)
class ActionEntry:
    """An action of the server.

    Attributes:
        action: The action.
        keys: The keys of its own name, by their field names in the list.
        services: Its three services.
        topics: Its two topics.
    """

    action: ActionName
    keys: Mapping[str, str]
    services: tuple[ServiceEntry, ...]
    topics: tuple[TopicEntry, ...]

    def describe(self) -> dict[str, Any]:
        """Returns the entry of the list."""
        return {
            "name": self.action.name,
            **self.keys,
            "type": self.action.type.TYPE,
            "hash": _hash(self.action.type),
            "services": [entry.describe() for entry in self.services],
            "topics": [entry.describe() for entry in self.topics],
        }


@dataclass(frozen=True, slots=True)
class Listing:
    """All topics, services and actions that the server has declared.

    Immutable, because Zenoh's threads read it while the server declares more.

    Attributes:
        name: The server's full name.
        version: mjplug's version.
        endpoint: The endpoint to which clients connect.
        topics: Its topics, except those of actions.
        services: Its services, except those of actions.
        actions: Its actions.
    """

    name: str
    version: str
    endpoint: str
    topics: tuple[TopicEntry, ...] = ()
    services: tuple[ServiceEntry, ...] = ()
    actions: tuple[ActionEntry, ...] = field(default=())

    def to_json(self, schema: bool = False) -> bytes:
        """Returns the list as JSON text; `schema` adds the definitions of all types."""
        content: dict[str, Any] = {
            "name": self.name,
            "version": self.version,
            "endpoint": self.endpoint,
            "topics": [entry.describe() for entry in self.topics],
            "services": [entry.describe() for entry in self.services],
            "actions": [entry.describe() for entry in self.actions],
        }
        if schema:
            types: list[Any] = [entry.topic.type for entry in self.topics]
            types += [entry.service.type for entry in self.services]
            types += [entry.action.type for entry in self.actions]
            content["types"] = {type.TYPE: _schema(type) for type in _with_nested(types)}
        return json.dumps(content).encode()


class InterfacesQueryable:
    """Replies with the current list, and notifies subscribers of changes.

    With the parameter `subscribed=<key>`, the reply instead states whether the publisher of that key has matched a
    subscriber. All subscribers that were declared before this query are matched.

    Args:
        session: The session.
        listing: The initial list.
        refresh: Updates the matching status of the publishers of a key; returns whether one has a subscriber.
    """

    def __init__(self, session: zenoh.Session, listing: Listing, refresh: Callable[[str], bool]) -> None:
        self._refresh = refresh
        self._listing = listing
        self._key = interfaces_key(listing.name)
        self._changes = session.declare_publisher(self._key, congestion_control=zenoh.CongestionControl.DROP)
        self._queryable = session.declare_queryable(self._key, callback(self._answer))

    @property
    def listing(self) -> Listing:
        """The current list; assign a new one to change it."""
        return self._listing

    @listing.setter
    def listing(self, listing: Listing) -> None:
        self._listing = listing
        self._changes.put(b"")

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            try:
                selected = parameters(query)
                if (key := selected.get("subscribed")) is not None:
                    payload = json.dumps({"key": key, "subscribed": self._refresh(key)}).encode()
                else:
                    payload = self.listing.to_json(selected.get("schema", "false") == "true")
            except Exception as error:
                _LOG.exception("building the list of interfaces failed")
                query.reply_err(f"building the list of interfaces failed: {error}".encode(), encoding=TEXT)
            else:
                query.reply(self._key, payload, encoding=zenoh.Encoding.APPLICATION_JSON)


def _hash(interface: Any) -> str:
    # Any: mypy does not accept a class as a hashable argument of a cached function.
    return type_hash(interface)


def _with_nested(types: Iterable[Any]) -> list[Any]:
    """Returns types, and the types of their fields at any depth, each of them once."""
    found: dict[str, Any] = {}
    pending = list(types)
    while pending:
        type = pending.pop(0)
        if type.TYPE not in found:
            found[type.TYPE] = type
            elements = (field.element for part in _parts(type) for field in fields(part))
            pending += [element for element in elements if not isinstance(element, Primitive)]
    return list(found.values())


def _parts(type: Any) -> tuple[Any, ...]:
    """Returns the messages of which a type consists."""
    if issubclass(type, Action):
        return type.Goal, type.Result, type.Feedback
    return (type,) if issubclass(type, Message) else (type.Request, type.Response)


@cache
def _schema(type: Any) -> dict[str, Any]:
    if issubclass(type, Message):
        return {"definition": definition(type), "schema": type.model_json_schema()}
    if issubclass(type, Action):
        parts = {"goal": type.Goal, "result": type.Result, "feedback": type.Feedback}
        return {"definition": definition(type)} | {name: part.model_json_schema() for name, part in parts.items()}
    return {
        "definition": definition(type),
        "request": type.Request.model_json_schema(),
        "response": type.Response.model_json_schema(),
    }
