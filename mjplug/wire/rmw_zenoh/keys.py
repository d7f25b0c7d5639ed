"""Data keys: `<domain>/<name>/<type as in DDS>/<type hash>`, the same for a topic and for a service.

A sender names one hash. A subscription or a server declares its key with any hash (`*`), so that a node with another
definition of the type gets a refusal, or is counted and named in the log, instead of silence.
"""

from dataclasses import dataclass
from typing import Any, Literal

from mjplug_schemas import names
from mjplug_schemas.message import Message, Service
from mjplug_schemas.rihs01 import type_hash

Distro = Literal["humble", "jazzy", "kilted", "lyrical", "rolling"]

NO_HASH = "TypeHashNotSupported"
"""What stands in place of a type hash in Humble, which has none."""


@dataclass(frozen=True, slots=True)
class RosSettings:
    """Which ROS 2 nodes the server speaks with.

    Attributes:
        domain_id: Their ROS_DOMAIN_ID.
        distro: Their distribution; only Humble differs from the others.
    """

    domain_id: int = 0
    distro: Distro = "jazzy"

    def type_hash(self, interface: type[Message] | type[Service]) -> str:
        """Returns the hash of a type as the distribution writes it."""
        # Any: mypy does not take a class for a hashable argument of a cached function.
        hashable: Any = interface
        return NO_HASH if self.distro == "humble" else type_hash(hashable)

    def data_key(self, name: str, interface: type[Message] | type[Service]) -> str:
        """Returns the key of a topic or service by its full ROS name."""
        return f"{self._any_key(name, interface)}/{self.type_hash(interface)}"

    def any_hash_key(self, name: str, interface: type[Message] | type[Service]) -> str:
        """Returns the same key with the hash left open."""
        return f"{self._any_key(name, interface)}/*"

    def _any_key(self, name: str, interface: type[Message] | type[Service]) -> str:
        return f"{self.domain_id}/{names.key(name)}/{names.dds_type(interface.TYPE)}"


def foreign_definition(key: str, interface: type[Message] | type[Service]) -> str:
    """Returns why bytes with this data key cannot be decoded; empty if they can.

    The last chunk of the key is the hash of the definition that the sender has. Humble has no hashes, and a query may
    leave the hash open: both are taken for our definition.
    """
    # Any: mypy does not take a class for a hashable argument of a cached function.
    hashable: Any = interface
    theirs, ours = key.rpartition("/")[2], type_hash(hashable)
    if theirs in (ours, NO_HASH, "*"):
        return ""
    return f"the sender has another definition of {interface.TYPE}: its type hash is {theirs}, here it is {ours}"
