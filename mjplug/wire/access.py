"""What each role may do, as access rules of Zenoh that are made from the server's own topics and services.

Zenoh compares the key expression of a message with those of the rules, and a rule holds for a message whose expression
it includes as a whole. So a wildcard cannot be kept out by a rule against some keys that it matches; it has to be left
out of what is permitted. Everything that changes something is therefore permitted key by key, and nothing else is.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from mjplug.contracts.transport import ServiceName, Topic
from mjplug.security.roles import Role
from mjplug.wire.discovery.format import TOKENS
from mjplug.wire.plain import key_of
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.rmw_zenoh.tokens import ROOT
from mjplug.wire.shared_names import READY
from mjplug_schemas import names

READ_ONLY: Final = frozenset(
    {
        "rcl_interfaces/srv/DescribeParameters",
        "rcl_interfaces/srv/GetParameterTypes",
        "rcl_interfaces/srv/GetParameters",
        "rcl_interfaces/srv/ListParameters",
        "type_description_interfaces/srv/GetTypeDescription",
    }
)
"""The types of services that change nothing. A service of any other type is taken for a command."""

READ_ONLY_NAMES: Final = ("get_diagnostics",)
"""Services of the server itself that change nothing, although their type does not say so."""

HISTORY: Final = "@adv"
"""Chunk in the keys from which late subscribers get the last messages of a latched topic."""

VIEW: Final = "@view"
"""Chunk in the keys of the view of a simulation; `VIEW_READ` are those that may be asked, `VIEW_COMMAND` commands."""

VIEW_READ: Final = ("info", "scene", "model")
VIEW_COMMAND: Final = ("drag",)

EVERYTHING: Final = (
    "**",
    "**/@json",
    f"**/{HISTORY}/**",
    f"**/@json/{HISTORY}/**",
    f"**/{VIEW}/**",
    f"{TOKENS}/**",
    f"{TOKENS}/**/{READY}",
    f"{ROOT}/**",
)
"""`*` and `**` match no chunk that begins with `@`."""

_LISTEN = ("declare_subscriber", "liveliness_query", "declare_liveliness_subscriber")
_SHOWN = ("put", "delete", "reply", "liveliness_token", "declare_subscriber", "declare_queryable")
_ALL = (*_SHOWN, "query", "liveliness_query", "declare_liveliness_subscriber")


@dataclass(frozen=True, slots=True)
class Interfaces:
    """What a server declares.

    Attributes:
        name: The server's full name, such as `/robot1/mjplug`.
        published: The topics that it publishes.
        subscribed: The topics that it subscribes to.
        services: Its services.
        ros2: How ROS 2 nodes see them; None if they do not.
    """

    name: str
    published: Sequence[Topic[Any]]
    subscribed: Sequence[Topic[Any]]
    services: Sequence[ServiceName]
    ros2: RosSettings | None = None

    def reads(self, service: ServiceName) -> bool:
        """Whether a service changes nothing."""
        own = (f"{self.name}/{name}" for name in READ_ONLY_NAMES)
        return service.type.TYPE in READ_ONLY or service.name in own

    def topic_keys(self, topics: Iterable[Topic[Any]]) -> Iterator[str]:
        """Returns all keys of some topics."""
        for topic in topics:
            yield key_of(topic.name)
            yield key_of(topic.name, "json")
            if self.ros2 is not None:
                yield self.ros2.any_hash_key(topic.name, topic.type)

    def service_keys(self, services: Iterable[ServiceName]) -> Iterator[str]:
        """Returns all keys of some services."""
        for service in services:
            yield key_of(service.name)
            if self.ros2 is not None:
                yield self.ros2.any_hash_key(service.name, service.type)


def access_control(interfaces: Interfaces, roles: Mapping[str, Role], known_by: str) -> dict[str, Any]:
    """Returns the access rules of a server, as the value of Zenoh's setting `access_control`.

    A client without a role may do nothing.

    Args:
        interfaces: What the server declares.
        roles: The roles by name.
        known_by: How Zenoh knows the names: `cert_common_names` or `usernames`.
    """
    # Zenoh takes no rule without keys.
    rules = {role: [rule for rule in make(interfaces) if rule["key_exprs"]] for role, make in _RULES.items()}
    subjects = {role: sorted(name for name, has in roles.items() if has == role) for role in rules}
    used = [role for role in rules if subjects[role]]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [rule for role in used for rule in rules[role]],
        "subjects": [{"id": role, known_by: subjects[role]} for role in used],
        "policies": [{"rules": [rule["id"] for rule in rules[role]], "subjects": [role]} for role in used],
    }


def _viewer(interfaces: Interfaces) -> Iterator[dict[str, Any]]:
    read = [service for service in interfaces.services if interfaces.reads(service)]
    commands = [service for service in interfaces.services if not interfaces.reads(service)]
    latched = (topic for topic in interfaces.published if topic.qos.durability == "transient_local")
    ask = [
        "**/interfaces",
        f"**/{HISTORY}/**",
        f"**/@json/{HISTORY}/**",
        *(f"{names.key(interfaces.name)}/{VIEW}/{what}" for what in VIEW_READ),
        *interfaces.service_keys(read),
        *interfaces.topic_keys(latched),
    ]
    yield _rule("viewer listens", "ingress", _LISTEN, EVERYTHING)
    yield _rule("viewer is shown", "egress", _SHOWN, EVERYTHING)
    yield _rule("viewer asks", "ingress", ["query"], ask)
    # Only matters to one whose name ends with `/interfaces`.
    yield _rule("viewer commands nothing", "ingress", ["query"], interfaces.service_keys(commands), "deny")


def _operator(interfaces: Interfaces) -> Iterator[dict[str, Any]]:
    server = names.key(interfaces.name)
    inputs = [*interfaces.topic_keys(interfaces.subscribed), *(f"{server}/{VIEW}/{what}" for what in VIEW_COMMAND)]
    yield _rule("operator listens and calls", "ingress", [*_LISTEN, "query"], EVERYTHING)
    yield _rule("operator is shown", "egress", _ALL, EVERYTHING)
    yield _rule("operator commands", "ingress", ["put"], inputs)
    # The history of what an operator publishes, for a topic that the server reads latched.
    yield _rule(
        "operator has a history",
        "ingress",
        ["put", "declare_queryable", "reply", "liveliness_token"],
        [f"{key}/{HISTORY}/**" for key in interfaces.topic_keys(interfaces.subscribed)],
    )
    yield _rule("operator replies with its history", "ingress", ["reply"], inputs)
    # In the ROS 2 graph, as any node but the server's.
    namespace, _, node = interfaces.name.rpartition("/")
    own = f"{ROOT}/*/*/*/*/*/*/{(namespace or '/').replace('/', '%')}/{node}"
    yield _rule("operator is in the graph", "ingress", ["liveliness_token"], [f"{ROOT}/**"])
    yield _rule("operator is not the server", "ingress", ["liveliness_token"], [own, f"{own}/**"], "deny")


def _worker(interfaces: Interfaces) -> Iterator[dict[str, Any]]:
    outputs = [*interfaces.topic_keys(interfaces.published)]
    view = f"{names.key(interfaces.name)}/{VIEW}/**"
    latched = ["put", "declare_queryable", "reply", "liveliness_token"]
    yield _rule("worker is shown", "egress", _ALL, EVERYTHING)
    yield _rule("worker publishes", "ingress", latched, [*outputs, view])
    yield _rule("worker has a history", "ingress", latched, [f"{key}/{HISTORY}/**" for key in outputs])
    yield _rule("worker looks for late subscribers", "ingress", _LISTEN, [f"**/{HISTORY}/**", view])


def _server(interfaces: Interfaces) -> Iterator[dict[str, Any]]:
    yield _rule("server comes in", "ingress", _ALL, EVERYTHING)
    yield _rule("server goes out", "egress", _ALL, EVERYTHING)


_RULES = {"viewer": _viewer, "operator": _operator, "worker": _worker, "server": _server}


def _rule(
    id: str, flow: str, messages: Iterable[str], keys: Iterable[str], permission: str = "allow"
) -> dict[str, Any]:
    return {
        "id": id,
        "permission": permission,
        "flows": [flow],
        "messages": [*messages],
        "key_exprs": [*dict.fromkeys(keys)],
    }
