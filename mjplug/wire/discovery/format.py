"""The list of interfaces that a server offers: its JSON form, and how it is decoded.

`answers` encodes it, and `questions` queries it. Any program can reply, so every name, type and key is validated.
"""

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

from mjplug.errors import MjplugError, quoted
from mjplug_schemas.errors import NameRuleError
from mjplug_schemas.names import validate_name

LONGEST_KEY = 65535
"""The longest key that Zenoh can send [bytes]; a longer one makes it panic."""

_TYPE = re.compile(r"[A-Za-z0-9_]+/(msg|srv|action)/[A-Za-z0-9_]+")


class UnreadableListError(MjplugError):
    """A reply is not a list of interfaces."""


@dataclass(frozen=True, slots=True)
class TopicInfo:
    """A topic, and the servers that publish it or subscribe to it.

    Attributes:
        name: Its full name, such as `/clock`.
        type: The name of its type, such as `rosgraph_msgs/msg/Clock`.
        hash: The RIHS01 hash of the type.
        key: Its Zenoh key for CDR.
        json_key: Its Zenoh key for JSON.
        reliability: `reliable` or `best_effort`.
        durability: `volatile`, or `transient_local` for a latched topic.
        depth: How many messages are kept for a slow or late subscriber.
        publishers: The servers that publish it.
        subscribers: The servers that subscribe to it.
    """

    name: str
    type: str
    hash: str
    key: str
    json_key: str
    reliability: str
    durability: str
    depth: int
    publishers: tuple[str, ...]
    subscribers: tuple[str, ...]

    @property
    def latched(self) -> bool:
        """Whether late subscribers get the last messages."""
        return self.durability == "transient_local"


@dataclass(frozen=True, slots=True)
class ServiceInfo:
    """A service.

    Attributes:
        name: Its full name, such as `/mjplug/set_pause`.
        type: The name of its type.
        hash: The RIHS01 hash of the type.
        key: Its Zenoh key.
        server: The server that offers it.
    """

    name: str
    type: str
    hash: str
    key: str
    server: str


@dataclass(frozen=True, slots=True)
class ActionInfo:
    """An action.

    Attributes:
        name: Its full name, such as `/arm_controller/follow_joint_trajectory`.
        type: The name of its type.
        hash: The RIHS01 hash of the type.
        key: Its Zenoh key, where a goal can be sent with one query.
        server: The server that offers it.
        topics: Its topics `feedback` and `status`, by full name.
        services: Its services `send_goal`, `cancel_goal` and `get_result`, by full name.
    """

    name: str
    type: str
    hash: str
    key: str
    server: str
    topics: dict[str, TopicInfo]
    services: dict[str, ServiceInfo]


@dataclass(frozen=True, slots=True)
class ServerInfo:
    """A server with its topics, services and actions.

    Attributes:
        name: Its full name, such as `/mjplug`.
        version: Its version of mjplug.
        endpoint: The endpoint for clients on its machine.
        topics: Its topics by name, without those of actions.
        services: Its services by name, without those of actions.
        actions: Its actions by name.
    """

    name: str
    version: str
    endpoint: str
    topics: dict[str, TopicInfo]
    services: dict[str, ServiceInfo]
    actions: dict[str, ActionInfo]

    @property
    def every_topic(self) -> dict[str, TopicInfo]:
        """The topics by name, with those of actions."""
        return self.topics | {name: topic for action in self.actions.values() for name, topic in action.topics.items()}

    @property
    def every_service(self) -> dict[str, ServiceInfo]:
        """The services by name, with those of actions."""
        hidden = (action.services.items() for action in self.actions.values())
        return self.services | dict(chain.from_iterable(hidden))


def read(name: str, answer: bytes) -> ServerInfo:
    """Decodes a server's list of interfaces.

    Args:
        name: The server's full name.
        answer: The server's reply, as JSON text.

    Raises:
        UnreadableListError: The reply is not a list of interfaces of this server.
    """
    return parse(checked(name, answer))


def checked(name: str, answer: bytes) -> dict[str, Any]:
    """Validates a reply and returns it. Any program can reply, and names and types are printed and used as keys."""
    try:
        content: dict[str, Any] = json.loads(answer)
        if content["name"] != name:
            raise ValueError(f"the name in it is {quoted(str(content['name']))}")
        actions = content.get("actions", ())
        parts = (entry for action in actions for entry in (*action["topics"], *action["services"]))
        for entry in (*content["topics"], *content["services"], *actions, *parts):
            validate_name(entry["name"])
            if not _TYPE.fullmatch(entry["type"]):
                raise ValueError(f"{quoted(entry['type'])} is not the name of a type")
            for field in ("key", "json_key"):
                if len(entry.get(field, "").encode()) > LONGEST_KEY:
                    # Zenoh would panic when a request is sent to it.
                    raise ValueError(f"the key {quoted(entry[field])} is longer than {LONGEST_KEY} bytes")
        parse(content)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError, NameRuleError) as error:
        raise UnreadableListError(f"server {name} sent a list of interfaces that cannot be read: {error!r}") from None
    return content


def parse(values: dict[str, Any]) -> ServerInfo:
    """Returns the server that a valid list describes."""
    name = values["name"]
    return ServerInfo(
        name,
        values["version"],
        values["endpoint"],
        _topics(values["topics"], name),
        _services(values["services"], name),
        # Servers of earlier versions have no actions.
        {entry["name"]: _action(entry, name) for entry in values.get("actions", ())},
    )


def _topics(entries: Iterable[dict[str, Any]], server: str) -> dict[str, TopicInfo]:
    topics: dict[str, TopicInfo] = {}
    for entry in entries:
        qos = entry["qos"]
        topic = TopicInfo(
            name=entry["name"],
            type=entry["type"],
            hash=entry["hash"],
            key=entry["key"],
            json_key=entry["json_key"],
            reliability=qos["reliability"],
            durability=qos["durability"],
            depth=qos["depth"],
            publishers=(server,) if entry["direction"] == "published" else (),
            subscribers=(server,) if entry["direction"] == "subscribed" else (),
        )
        topics[topic.name] = _joined(topics.get(topic.name), topic)
    return topics


def _services(entries: Iterable[dict[str, Any]], server: str) -> dict[str, ServiceInfo]:
    services = (ServiceInfo(**{f: e[f] for f in ("name", "type", "hash", "key")}, server=server) for e in entries)
    return {service.name: service for service in services}


def _action(entry: dict[str, Any], server: str) -> ActionInfo:
    own = {field: entry[field] for field in ("name", "type", "hash", "key")}
    topics, services = _topics(entry["topics"], server), _services(entry["services"], server)
    return ActionInfo(**own, server=server, topics=topics, services=services)


def all_topics(servers: Iterable[ServerInfo], hidden: bool = False) -> dict[str, TopicInfo]:
    """Returns the topics of several servers by name, in alphabetical order; with `hidden`, those of actions too."""
    found: dict[str, TopicInfo] = {}
    for server in servers:
        for name, topic in (server.every_topic if hidden else server.topics).items():
            found[name] = _joined(found.get(name), topic)
    return dict(sorted(found.items()))


def all_services(servers: Iterable[ServerInfo], hidden: bool = False) -> dict[str, ServiceInfo]:
    """Returns the services of several servers by name, in alphabetical order; with `hidden`, those of actions too."""
    offered = (server.every_service if hidden else server.services for server in servers)
    return dict(sorted((name, service) for services in offered for name, service in services.items()))


def all_actions(servers: Iterable[ServerInfo]) -> dict[str, ActionInfo]:
    """Returns the actions of several servers by name, in alphabetical order."""
    return dict(sorted((name, action) for server in servers for name, action in server.actions.items()))


def _joined(first: TopicInfo | None, second: TopicInfo) -> TopicInfo:
    """Joins two entries of a topic, with the quality of service of the publisher."""
    if first is None:
        return second
    main, other = (second, first) if second.publishers and not first.publishers else (first, second)
    return replace(
        main,
        publishers=tuple(dict.fromkeys((*main.publishers, *other.publishers))),
        subscribers=tuple(dict.fromkeys((*main.subscribers, *other.subscribers))),
    )
