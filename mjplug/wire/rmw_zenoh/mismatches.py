"""Says when a ROS 2 node means another definition by the name of a type.

The graph of such a node shows a match, since it compares names and types only, but no message arrives: the type hash is
part of the key. Nobody else would tell the user.
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

MOST_HASHES = 4
"""How many foreign type hashes of one topic or service get a warning of their own.

Any program on the network can announce any number of them, so the others are counted, and logged at the first, the
tenth, the hundredth and so on.
"""

_WHAT: Final[dict[EndpointKind, str]] = {
    "MP": "a publisher",
    "MS": "a subscription",
    "SS": "a server",
    "SC": "a client",
}


class Mismatches:
    """Watches the endpoints that ours could talk with, by their tokens.

    Args:
        session: The session.
        domain_id: The ROS domain.
        name: Our node's full name.
    """

    def __init__(self, session: zenoh.Session, domain_id: int, name: str) -> None:
        self._liveliness = session.liveliness()
        self._domain_id = domain_id
        self._interfaces = f"{names.key(name)}/interfaces?schema=true"
        self._own_zid = str(session.zid())
        self._watchers: list[object] = []
        self._reported: dict[str, set[str]] = {}

    def watch(self, kind: EndpointKind, name: str, type_name: str, type_hash: str) -> None:
        """Warns of endpoints on the other side of this one that have another type hash.

        Each hash gets one warning; after `MOST_HASHES` of one name, warnings become rare.

        Args:
            kind: What ours is.
            name: Full ROS name of the topic or service.
            type_name: Its type.
            type_hash: Our hash of it.
        """
        other = OPPOSITE[kind]

        reported = self._reported.setdefault(name, set())
        more = Rejections(f"{name}: nodes announce further type hashes of {type_name}")

        def appeared(sample: zenoh.Sample) -> None:
            if sample.kind != zenoh.SampleKind.PUT:
                return
            endpoint = read_endpoint(str(sample.key_expr))
            if endpoint.zid == self._own_zid or endpoint.type_hash == type_hash or endpoint.type_hash in reported:
                return
            if len(reported) >= MOST_HASHES:
                more.add(f"the latest is {endpoint.type_hash} of {_WHAT[other]} of node {endpoint.node}")
                return
            reported.add(endpoint.type_hash)
            _LOG.warning(
                "%s: node %s has %s for %s with type hash %s, mjplug has %s. %s",
                name,
                endpoint.node,
                _WHAT[other],
                type_name,
                endpoint.type_hash,
                type_hash,
                self._way_out(type_name, endpoint.type_hash, type_hash),
            )

        tokens = endpoints_of(self._domain_id, other, name, type_name)
        handler = callback(appeared)
        self._watchers.append(self._liveliness.declare_subscriber(tokens, handler, history=True))

    def _way_out(self, type_name: str, theirs: str, ours: str) -> str:
        if theirs == NO_HASH:
            return "The node is on ROS 2 Humble: set ros2.distro to humble if all nodes of this domain are."
        if ours == NO_HASH:
            return "The node is not on ROS 2 Humble: set ros2.distro to what it is on, such as jazzy."
        package = type_name.partition("/")[0]
        return (
            f"Messages may not get through: both need the same definition, so install another version of {package} "
            f"there (`ros2 interface show {type_name}` shows theirs, a query of {self._interfaces} shows ours)."
        )
