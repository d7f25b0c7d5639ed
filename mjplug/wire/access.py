"""Zenoh access rules for each role, generated from the server's own topics and services.

A rule applies to a message if a key expression of the rule includes the whole key expression of the message. A rule
that denies some keys therefore does not deny a wildcard that matches them. For this reason everything is denied by
default, and everything that changes the simulation is allowed key by key.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from mjplug.contracts.actions import ActionName
from mjplug.contracts.transport import ServiceName, Topic
from mjplug.security.roles import Role
from mjplug.wire.discovery.announced import TOKENS
from mjplug.wire.plain import key_of
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.rmw_zenoh.tokens import ROOT
from mjplug.wire.shared_names import READY
from mjplug_schemas import names

READ_ONLY: Final = frozenset(
    {
        "mjplug_msgs/srv/GetStateDigest",
        "mjplug_msgs/srv/ListStates",
        "rcl_interfaces/srv/DescribeParameters",
        "rcl_interfaces/srv/GetParameterTypes",
        "rcl_interfaces/srv/GetParameters",
        "rcl_interfaces/srv/ListParameters",
        "simulation_interfaces/srv/GetAvailableWorlds",
        "simulation_interfaces/srv/GetCurrentWorld",
        "simulation_interfaces/srv/GetEntities",
        "simulation_interfaces/srv/GetEntitiesStates",
        "simulation_interfaces/srv/GetEntityBounds",
        "simulation_interfaces/srv/GetEntityInfo",
        "simulation_interfaces/srv/GetEntityState",
        "simulation_interfaces/srv/GetNamedPoseBounds",
        "simulation_interfaces/srv/GetNamedPoses",
        "simulation_interfaces/srv/GetSimulationState",
        "simulation_interfaces/srv/GetSimulatorFeatures",
        "simulation_interfaces/srv/GetSpawnables",
        "type_description_interfaces/srv/GetTypeDescription",
    }
)
"""Types of services that change nothing. A service of any other type is treated as a command."""

READ_ONLY_NAMES: Final = ("get_diagnostics",)
"""Services of the server itself that change nothing, although their type is not in `READ_ONLY`."""

HISTORY: Final = "@adv"
"""Chunk in the keys from which late subscribers get the last messages of a latched topic."""

VIEW: Final = "@view"
"""Chunk in the keys of the simulation view. `VIEW_READ` may be queried; `VIEW_COMMAND` are commands."""

VIEW_READ: Final = ("info", "scene", "model")
VIEW_COMMAND: Final = ("drag",)

VIEWERS: Final = "viewer"
"""Chunk in the keys of the liveliness tokens of viewers that drag bodies."""

STEP: Final = "@step"
"""Chunk in the keys of the liveliness tokens of clients that step the server."""

ALL_KEYS: Final = (
    "**",
    "**/@json",
    f"**/{HISTORY}/**",
    f"**/@json/{HISTORY}/**",
    f"**/{VIEW}/**",
    f"**/{STEP}/**",
    f"{TOKENS}/**",
    f"{TOKENS}/**/{READY}",
    f"{ROOT}/**",
)
"""Key expressions that together match all keys; `*` and `**` match no chunk that begins with `@`."""

_SUBSCRIBE = ("declare_subscriber", "liveliness_query", "declare_liveliness_subscriber")
_RECEIVE = ("put", "delete", "reply", "liveliness_token", "declare_subscriber", "declare_queryable")
_ALL = (*_RECEIVE, "query", "liveliness_query", "declare_liveliness_subscriber")


@dataclass(frozen=True, slots=True)
class Interfaces:
    """The topics, services and actions that a server declares.

    Attributes:
        name: The server's full name, such as `/robot1/mjplug`.
        published: The topics that it publishes.
        subscribed: The topics that it subscribes to.
        services: Its services, with those of actions.
        ros2: Settings of the rmw_zenoh dialect; None if it is off.
        actions: Its actions.
    """

    name: str
    published: Sequence[Topic[Any]]
    subscribed: Sequence[Topic[Any]]
    services: Sequence[ServiceName]
    ros2: RosSettings | None = None
    actions: Sequence[ActionName] = ()

    def reads(self, service: ServiceName) -> bool:
        """Returns whether a service changes nothing."""
        own = (f"{self.name}/{name}" for name in READ_ONLY_NAMES)
        return service.type.TYPE in READ_ONLY or service.name in own

    def topic_keys(self, topics: Iterable[Topic[Any]]) -> Iterator[str]:
        """Yields all keys of some topics."""
        for topic in topics:
            yield key_of(topic.name)
            yield key_of(topic.name, "json")
            if self.ros2 is not None:
                yield self.ros2.any_hash_key(topic.name, topic.type)

    def service_keys(self, services: Iterable[ServiceName]) -> Iterator[str]:
        """Yields all keys of some services."""
        for service in services:
            yield key_of(service.name)
            if self.ros2 is not None:
                yield self.ros2.any_hash_key(service.name, service.type)


def access_control(interfaces: Interfaces, roles: Mapping[str, Role], identified_by: str) -> dict[str, Any]:
    """Returns the access rules of a server, as the value of Zenoh's setting `access_control`.

    A client without a role is denied everything.

    Args:
        interfaces: The topics and services of the server.
        roles: The role of each client, by the client's name.
        identified_by: Where Zenoh reads the client's name: `cert_common_names` or `usernames`.
    """
    # Zenoh refuses a rule without keys.
    rules = {role: [rule for rule in make(interfaces) if rule["key_exprs"]] for role, make in _RULES.items()}
    subjects = {role: sorted(name for name, own in roles.items() if own == role) for role in rules}
    used = [role for role in rules if subjects[role]]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [rule for role in used for rule in rules[role]],
        "subjects": [{"id": role, identified_by: subjects[role]} for role in used],
        "policies": [{"rules": [rule["id"] for rule in rules[role]], "subjects": [role]} for role in used],
    }


def _viewer(interfaces: Interfaces) -> Iterator[dict[str, Any]]:
    read = [service for service in interfaces.services if interfaces.reads(service)]
    commands = [service for service in interfaces.services if not interfaces.reads(service)]
    latched = (topic for topic in interfaces.published if topic.qos.durability == "transient_local")
    queried = [
        "**/interfaces",
        f"**/{HISTORY}/**",
        f"**/@json/{HISTORY}/**",
        *(f"{names.key(interfaces.name)}/{VIEW}/{what}" for what in VIEW_READ),
        *interfaces.service_keys(read),
        *interfaces.topic_keys(latched),
    ]
    yield _rule("viewer subscribes", "ingress", _SUBSCRIBE, ALL_KEYS)
    yield _rule("viewer receives", "egress", _RECEIVE, ALL_KEYS)
    yield _rule("viewer queries", "ingress", ["query"], queried)
    # Needed only for a command whose name ends with `/interfaces`.
    goals = (key_of(action.name) for action in interfaces.actions)
    denied = [*interfaces.service_keys(commands), *goals]
    yield _rule("viewer sends no commands", "ingress", ["query"], denied, "deny")


def _operator(interfaces: Interfaces) -> Iterator[dict[str, Any]]:
    server = names.key(interfaces.name)
    inputs = [*interfaces.topic_keys(interfaces.subscribed), *(f"{server}/{VIEW}/{what}" for what in VIEW_COMMAND)]
    yield _rule("operator subscribes and calls", "ingress", [*_SUBSCRIBE, "query"], ALL_KEYS)
    yield _rule("operator receives", "egress", _ALL, ALL_KEYS)
    yield _rule("operator publishes commands", "ingress", ["put"], inputs)
    # By these, the server detects that a viewer has disconnected.
    yield _rule("operator declares viewers", "ingress", ["liveliness_token"], [f"{server}/{VIEW}/{VIEWERS}/*"])
    # By these, the server detects that a client that stepped it has disconnected.
    yield _rule("operator declares that it steps", "ingress", ["liveliness_token"], [f"{server}/{STEP}/*"])
    # For latched topics that the server subscribes to: the history of an operator's publisher.
    yield _rule(
        "operator offers its history",
        "ingress",
        ["put", "declare_queryable", "reply", "liveliness_token"],
        [f"{key}/{HISTORY}/**" for key in interfaces.topic_keys(interfaces.subscribed)],
    )
    yield _rule("operator replies with its history", "ingress", ["reply"], inputs)
    # An operator may declare any ROS 2 node except the server's own.
    namespace, _, node = interfaces.name.rpartition("/")
    own = f"{ROOT}/*/*/*/*/*/*/{(namespace or '/').replace('/', '%')}/{node}"
    yield _rule("operator declares nodes", "ingress", ["liveliness_token"], [f"{ROOT}/**"])
    yield _rule("operator does not declare the server", "ingress", ["liveliness_token"], [own, f"{own}/**"], "deny")


def _worker(interfaces: Interfaces) -> Iterator[dict[str, Any]]:
    outputs = [*interfaces.topic_keys(interfaces.published)]
    view = f"{names.key(interfaces.name)}/{VIEW}/**"
    latched = ["put", "declare_queryable", "reply", "liveliness_token"]
    yield _rule("worker receives", "egress", _ALL, ALL_KEYS)
    yield _rule("worker publishes", "ingress", latched, [*outputs, view])
    yield _rule("worker offers its history", "ingress", latched, [f"{key}/{HISTORY}/**" for key in outputs])
    yield _rule("worker detects late subscribers", "ingress", _SUBSCRIBE, [f"**/{HISTORY}/**", view])


def _server(interfaces: Interfaces) -> Iterator[dict[str, Any]]:
    yield _rule("server sends", "ingress", _ALL, ALL_KEYS)
    yield _rule("server receives", "egress", _ALL, ALL_KEYS)


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
