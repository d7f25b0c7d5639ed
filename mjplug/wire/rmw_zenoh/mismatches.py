"""Logs a warning when a ROS 2 node uses another definition of a type.

The ROS graph shows such endpoints as matched, because it compares names and types only. But no message arrives, because
the type hash is part of the key. ROS itself gives no warning.
"""

import logging
from typing import Final

import zenoh

from mjplug.wire.callbacks import callback
from mjplug.wire.rejections import Rejections
from mjplug.wire.rmw_zenoh.keys import NO_HASH
from mjplug.wire.rmw_zenoh.tokens import OPPOSITE, EndpointKind, endpoints_of, read_endpoint
from mjplug_schemas import names

_LOG = logging.getLogger(__name__)

MAX_REPORTED_HASHES = 4
"""Maximum number of different type hashes of one topic or service that are logged separately.

Any program on the network can announce any number of hashes, so further ones are counted, and the first, the tenth, the
hundredth and so on is logged.
"""

_WHAT: Final[dict[EndpointKind, str]] = {
    "MP": "a publisher",
    "MS": "a subscription",
    "SS": "a server",
    "SC": "a client",
}


class Mismatches:
    """Watches the liveliness tokens of endpoints that could be matched with the server's.

    Args:
        session: The session.
        domain_id: The ROS domain.
        name: Full name of the server's node.
    """

    def __init__(self, session: zenoh.Session, domain_id: int, name: str) -> None:
        self._liveliness = session.liveliness()
        self._domain_id = domain_id
        self._interfaces = f"{names.key(name)}/interfaces?schema=true"
        self._own_zid = str(session.zid())
        self._watchers: list[object] = []
        self._reported: dict[str, set[str]] = {}

    def watch(self, kind: EndpointKind, name: str, type_name: str, type_hash: str) -> None:
        """Starts to log warnings about opposite endpoints with another type hash.

        Each hash gets one warning; after `MAX_REPORTED_HASHES` hashes of one name, warnings become rare.

        Args:
            kind: Kind of the server's endpoint.
            name: Full ROS name of the topic or service.
            type_name: Its type.
            type_hash: The server's hash of the type.
        """
        other = OPPOSITE[kind]

        reported = self._reported.setdefault(name, set())
        more = Rejections(f"{name}: nodes announce more type hashes of {type_name}")

        def appeared(sample: zenoh.Sample) -> None:
            if sample.kind != zenoh.SampleKind.PUT:
                return
            endpoint = read_endpoint(str(sample.key_expr))
            if endpoint.zid == self._own_zid or endpoint.type_hash == type_hash or endpoint.type_hash in reported:
                return
            if len(reported) >= MAX_REPORTED_HASHES:
                more.add(f"the latest is {endpoint.type_hash} of {_WHAT[other]} of node {endpoint.node}")
                return
            reported.add(endpoint.type_hash)
            _LOG.warning(
                "%s: node %s has %s of type %s with type hash %s; the hash of mjplug is %s. %s",
                name,
                endpoint.node,
                _WHAT[other],
                type_name,
                endpoint.type_hash,
                type_hash,
                self._advice(type_name, endpoint.type_hash, type_hash),
            )

        tokens = endpoints_of(self._domain_id, other, name, type_name)
        handler = callback(appeared)
        self._watchers.append(self._liveliness.declare_subscriber(tokens, handler, history=True))

    def _advice(self, type_name: str, theirs: str, ours: str) -> str:
        if theirs == NO_HASH:
            return "The node runs on ROS 2 Humble; set ros2.distro to humble if all nodes of this domain do."
        if ours == NO_HASH:
            return "The node does not run on ROS 2 Humble; set ros2.distro to its distribution, such as jazzy."
        package = type_name.partition("/")[0]
        return (
            "Messages may not arrive, because both sides need the same definition; install another version of "
            f"{package} there (`ros2 interface show {type_name}` shows the node's definition, a query of "
            f"{self._interfaces} shows the server's)."
        )
