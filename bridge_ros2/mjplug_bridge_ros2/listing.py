"""What a server offers, as its queryable `<namespace>/<node_name>/interfaces` tells it."""

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
        depth: KEEP_LAST depth.
        reliable: Whether messages are sent again until they arrive; otherwise best effort.
        latched: Whether late joiners get the last messages, as with `transient_local`.
    """

    depth: int
    reliable: bool
    latched: bool


@dataclass(frozen=True)
class TopicEntry:
    """A topic of the server.

    Attributes:
        name: Full ROS name.
        key: Zenoh key of its CDR.
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


Entry = TopicEntry | ServiceEntry


def read_listing(payload: bytes) -> "list[Entry]":
    """Returns the topics and services, published topics first and `/clock` before all others.

    What a newer server tells in addition is ignored.

    Raises:
        ListingError: The payload is not such a list.
    """
    try:
        told = json.loads(payload)
        topics = [_topic(topic) for topic in told["topics"]]
        services = [ServiceEntry(**_common(service)) for service in told["services"]]
    except (ValueError, KeyError, TypeError) as error:
        raise ListingError(f"the list of interfaces cannot be read: {error!r}") from error
    topics.sort(key=lambda topic: (topic.name != "/clock", not topic.published))
    return [*topics, *services]


def _topic(told: "dict[str, Any]") -> TopicEntry:
    qos = told["qos"]
    return TopicEntry(
        **_common(told),
        published=_one_of(told["direction"], ("published", "subscribed")) == "published",
        qos=QoS(
            depth=int(qos["depth"]),
            reliable=_one_of(qos["reliability"], _RELIABILITIES) == "reliable",
            latched=_one_of(qos["durability"], _DURABILITIES) == "transient_local",
        ),
    )


def _common(told: "dict[str, Any]") -> "dict[str, str]":
    return {name: str(told[name]) for name in ("name", "key", "type", "hash")}


def _one_of(word: str, words: "tuple[str, ...]") -> str:
    if word not in words:
        raise ValueError(f"{word!r} is none of {', '.join(words)}")
    return word
