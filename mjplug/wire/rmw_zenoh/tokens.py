"""Liveliness tokens: all that ROS 2 nodes know of the graph.

A node has one, and so has each of its publishers, subscriptions, services and clients. They are gone when they are
undeclared, when the session closes and when its link is lost. Every node on the network reads every token, and logs an
error for one that it cannot read.
"""

from dataclasses import dataclass
from typing import Literal

from xxhash import xxh3_128_intdigest

from mjplug_schemas import names

ROOT = "@ros2_lv"
"""First chunk of every token; `*` and `**` do not match it."""

EndpointKind = Literal["MP", "MS", "SS", "SC"]
"""Publisher, subscription, service server, service client."""

OPPOSITE: dict[EndpointKind, EndpointKind] = {"MP": "MS", "MS": "MP", "SS": "SC", "SC": "SS"}
"""Who talks with whom."""


@dataclass(frozen=True, slots=True)
class Node:
    """A ROS 2 node on a Zenoh session.

    Attributes:
        domain_id: Its ROS domain.
        zid: The session's Zenoh id, in hexadecimal as Zenoh writes it.
        id: Its number; nodes and endpoints of one session are counted together.
        namespace: `/robot1`, or nothing for the root.
        name: Its name, without the namespace.
        enclave: Its place in a keystore of SROS 2.
    """

    domain_id: int
    zid: str
    id: int
    namespace: str
    name: str
    enclave: str = "/"

    @property
    def token(self) -> str:
        """The node's own token."""
        return f"{self._session}/{self.id}/NN/{self._names}"

    def endpoint_token(self, id: int, kind: EndpointKind, name: str, type_name: str, type_hash: str, qos: str) -> str:
        """Returns the token of an endpoint of this node.

        Args:
            id: Its number.
            kind: What it is.
            name: Full ROS name of the topic or service.
            type_name: Such as `std_msgs/msg/String`.
            type_hash: As in the data key.
            qos: What `qos_chunk` makes.
        """
        of_topic = f"{_one_chunk(name)}/{names.dds_type(type_name)}/{type_hash}/{qos}"
        return f"{self._session}/{id}/{kind}/{self._names}/{of_topic}"

    @property
    def _session(self) -> str:
        return f"{ROOT}/{self.domain_id}/{self.zid}/{self.id}"

    @property
    def _names(self) -> str:
        return f"{_one_chunk(self.enclave)}/{_one_chunk(self.namespace or '/')}/{self.name}"


@dataclass(frozen=True, slots=True)
class Endpoint:
    """What can be read from somebody's endpoint token.

    Attributes:
        zid: The Zenoh id of the session it is on.
        node: Full name of its node.
        type_hash: The hash of its type.
    """

    zid: str
    node: str
    type_hash: str


def endpoints_of(domain_id: int, kind: EndpointKind, name: str, type_name: str) -> str:
    """Returns a key expression for the tokens of all endpoints of one kind, name and type, whatever their hash."""
    return f"{ROOT}/{domain_id}/*/*/*/{kind}/*/*/*/{_one_chunk(name)}/{names.dds_type(type_name)}/**"


def read_endpoint(token: str) -> Endpoint:
    """Reads a token that matches `endpoints_of`."""
    _, _, zid, _, _, _, _, namespace, node, _, _, *rest = token.split("/")
    path = namespace.replace("%", "/").removesuffix("/")
    return Endpoint(zid, f"{path}/{node}", rest[0] if rest else "")


def gid(token: str) -> bytes:
    """Returns the 16 bytes by which rmw_zenoh knows the owner of a token: XXH3-128 of it, low byte first."""
    return xxh3_128_intdigest(token.encode()).to_bytes(16, "little")


def _one_chunk(name: str) -> str:
    return name.replace("/", "%")
