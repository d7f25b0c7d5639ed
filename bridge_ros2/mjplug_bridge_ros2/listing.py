"""The list of a server's interfaces, from its queryable `<namespace>/<node_name>/interfaces`."""

import json
from dataclasses import dataclass
from typing import Any

from mjplug_bridge_ros2.errors import ListingError

_RELIABILITIES = ("reliable", "best_effort")
_DURABILITIES = ("volatile", "transient_local")


@dataclass(frozen=True)
class QoS:
    """Quality of service of a topic.

    Attributes:
        depth: Queue depth with KEEP_LAST.
        reliable: Whether lost messages are sent again; otherwise best effort.
        latched: Whether late subscribers get the last messages (`transient_local`).
    """

    depth: int
    reliable: bool
    latched: bool


@dataclass(frozen=True)
class TopicEntry:
    """A topic of the server.

    Attributes:
        name: Full ROS name.
        key: Zenoh key of the CDR messages.
        type: ROS type name, such as `std_msgs/msg/String`.
        hash: RIHS01 hash of the type.
        published: Whether the server publishes it; otherwise it subscribes to it.
        qos: Quality of service.
    """

    name: str
    key: str
    type: str
    hash: str
    published: bool
    qos: QoS


@dataclass(frozen=True)
class ServiceEntry:
    """A service of the server.

    Attributes:
        name: Full ROS name.
        key: Zenoh key.
        type: ROS type name, such as `std_srvs/srv/Trigger`.
        hash: RIHS01 hash of the type.
    """

    name: str
    key: str
    type: str
    hash: str


@dataclass(frozen=True)
class ActionEntry:
    """An action of the server.

    Attributes:
        name: Full ROS name.
        type: ROS type name, such as `control_msgs/action/GripperCommand`.
        topics: Its topics, which the server publishes.
        services: Its services.
    """

    name: str
    type: str
    topics: "tuple[TopicEntry, ...]"
    services: "tuple[ServiceEntry, ...]"


Entry = TopicEntry | ServiceEntry | ActionEntry


def read_listing(payload: bytes) -> "list[Entry]":
    """Returns the topics, services and actions: `/clock` first, then the other published topics.

    Unknown fields of a newer server are ignored.

    Raises:
        ListingError: The payload is not such a list.
    """
    try:
        data = json.loads(payload)
        topics = [_topic(topic) for topic in data["topics"]]
        services = [ServiceEntry(**_common(service)) for service in data["services"]]
        # Servers of earlier versions list no actions.
        actions = [_action(action) for action in data.get("actions", ())]
    except (ValueError, KeyError, TypeError) as error:
        raise ListingError(f"the list of interfaces cannot be read: {error!r}") from error
    topics.sort(key=lambda topic: (topic.name != "/clock", not topic.published))
    return [*topics, *services, *actions]


def _topic(data: "dict[str, Any]") -> TopicEntry:
    qos = data["qos"]
    return TopicEntry(
        **_common(data),
        published=_one_of(data["direction"], ("published", "subscribed")) == "published",
        qos=QoS(
            depth=int(qos["depth"]),
            reliable=_one_of(qos["reliability"], _RELIABILITIES) == "reliable",
            latched=_one_of(qos["durability"], _DURABILITIES) == "transient_local",
        ),
    )


def _action(data: "dict[str, Any]") -> ActionEntry:
    topics = tuple(_topic(topic) for topic in data["topics"])
    services = tuple(ServiceEntry(**_common(service)) for service in data["services"])
    return ActionEntry(str(data["name"]), str(data["type"]), topics, services)


def _common(data: "dict[str, Any]") -> "dict[str, str]":
    return {name: str(data[name]) for name in ("name", "key", "type", "hash")}


def _one_of(word: str, words: "tuple[str, ...]") -> str:
    if word not in words:
        raise ValueError(f"{word!r} is not one of {', '.join(words)}")
    return word
