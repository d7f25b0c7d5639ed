"""Liveliness tokens, from which ROS 2 nodes build the ROS graph.

Each node has a token, and so has each of its publishers, subscriptions, services and clients. A token disappears when
it is undeclared, when its session is closed and when its link is lost. Every node on the network reads every token, and
logs an error for a token that it cannot read.
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
"""The kind of endpoint that each kind is matched with."""


@dataclass(frozen=True, slots=True)
class Node:
    """A ROS 2 node on a Zenoh session.

    Attributes:
        domain_id: Its ROS domain.
        zid: The session's Zenoh id, hexadecimal.
        id: Number of the node; nodes and endpoints of one session are numbered together.
        namespace: The namespace, such as `/robot1`; empty for the root.
        name: The node's name without the namespace.
        enclave: The node's enclave in SROS 2.
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
            id: Number of the endpoint.
            kind: Kind of the endpoint.
            name: Full ROS name of the topic or service.
            type_name: Type, such as `std_msgs/msg/String`.
            type_hash: Type hash as in the data key.
            qos: Result of `qos_chunk`.
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
    """The data of an endpoint that its token contains.

    Attributes:
        zid: Zenoh id of the endpoint's session.
        node: Full name of the endpoint's node.
        type_hash: Hash of the endpoint's type.
    """

    zid: str
    node: str
    type_hash: str


def endpoints_of(domain_id: int, kind: EndpointKind, name: str, type_name: str) -> str:
    """Returns a key expression for the tokens of all endpoints of one kind, name and type, with any type hash."""
    return f"{ROOT}/{domain_id}/*/*/*/{kind}/*/*/*/{_one_chunk(name)}/{names.dds_type(type_name)}/**"


def read_endpoint(token: str) -> Endpoint:
    """Reads a token that matches `endpoints_of`."""
    _, _, zid, _, _, _, _, namespace, node, _, _, *rest = token.split("/")
    path = namespace.replace("%", "/").removesuffix("/")
    return Endpoint(zid, f"{path}/{node}", rest[0] if rest else "")


def gid(token: str) -> bytes:
    """Returns the gid of an endpoint in rmw_zenoh, 16 bytes: the XXH3-128 hash of its token, little-endian."""
    return xxh3_128_intdigest(token.encode()).to_bytes(16, "little")


def _one_chunk(name: str) -> str:
    return name.replace("/", "%")
