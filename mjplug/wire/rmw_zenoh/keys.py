"""Data keys of topics and services: `<domain>/<name>/<type as in DDS>/<type hash>`.

A sender uses one hash. A subscription or service declares its key with any hash (`*`), so that a node with another
definition of the type gets a refusal or is counted and logged, instead of being ignored.
"""

from dataclasses import dataclass
from typing import Any, Literal

from mjplug_schemas import names
from mjplug_schemas.message import Message, Service
from mjplug_schemas.rihs01 import type_hash

Distro = Literal["humble", "jazzy", "kilted", "lyrical", "rolling"]

NO_HASH = "TypeHashNotSupported"
"""The text in place of a type hash in Humble, which has no type hashes."""


@dataclass(frozen=True, slots=True)
class RosSettings:
    """The ROS 2 domain and distribution of the nodes with which the server communicates.

    Attributes:
        domain_id: The ROS_DOMAIN_ID of the nodes.
        distro: The distribution of the nodes; only Humble differs from the others.
    """

    domain_id: int = 0
    distro: Distro = "jazzy"

    def type_hash(self, interface: type[Message] | type[Service]) -> str:
        """Returns the hash of a type as the distribution writes it."""
        # Any: mypy does not accept a class as a hashable argument of a cached function.
        hashable: Any = interface
        return NO_HASH if self.distro == "humble" else type_hash(hashable)

    def data_key(self, name: str, interface: type[Message] | type[Service]) -> str:
        """Returns the data key of a topic or service with a full ROS name."""
        return f"{self._any_key(name, interface)}/{self.type_hash(interface)}"

    def any_hash_key(self, name: str, interface: type[Message] | type[Service]) -> str:
        """Returns the data key with `*` in place of the hash."""
        return f"{self._any_key(name, interface)}/*"

    def _any_key(self, name: str, interface: type[Message] | type[Service]) -> str:
        return f"{self.domain_id}/{names.key(name)}/{names.dds_type(interface.TYPE)}"


def definition_mismatch(key: str, interface: type[Message] | type[Service]) -> str:
    """Returns why a payload with this data key cannot be decoded; empty if it can.

    The last chunk of the key is the hash of the sender's definition. Humble has no hashes, and a query may use `*`; in
    both cases the definitions are assumed to be equal.
    """
    # Any: mypy does not accept a class as a hashable argument of a cached function.
    hashable: Any = interface
    theirs, ours = key.rpartition("/")[2], type_hash(hashable)
    if theirs in (ours, NO_HASH, "*"):
        return ""
    return f"the sender uses another definition of {interface.TYPE}: its type hash is {theirs}, the server's is {ours}"
