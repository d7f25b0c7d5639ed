"""The topics of a bag: type, definition, quality of service, and how their messages are compressed."""

from dataclasses import dataclass
from typing import Any, Literal

import yaml

from mjplug.contracts.transport import DEFAULT, QoS

Compression = Literal["auto", "zstd", "lz4", "none"]

_LARGE = frozenset({"sensor_msgs/msg/Image", "sensor_msgs/msg/PointCloud2"})
_COMPRESSED = frozenset({"sensor_msgs/msg/CompressedImage"})

_FOREVER = {"sec": 9223372036, "nsec": 854775807}
_RELIABILITY = {"reliable": 1, "best_effort": 2}
_DURABILITY = {"transient_local": 1, "volatile": 2}
_KEEP_LAST = 1
_AUTOMATIC = 1


@dataclass(frozen=True, slots=True)
class BagTopic:
    """A topic in a bag.

    Attributes:
        name: Its full name.
        type: Name of its type.
        definition: Text of the type and of those of its fields, in the format `ros2msg`.
        hash: RIHS01 hash of the type; empty if unknown.
        qos: Its quality of service.
    """

    name: str
    type: str
    definition: str
    hash: str = ""
    qos: QoS = DEFAULT

    @property
    def latched(self) -> bool:
        """Whether late subscribers get its last messages."""
        return self.qos.durability == "transient_local"

    @property
    def channel_metadata(self) -> dict[str, str]:
        """The metadata of its channel in an MCAP file."""
        return {"offered_qos_profiles": qos_text(self.qos), "topic_type_hash": self.hash}

    def group(self, compression: Compression) -> str:
        """Returns the compression of its messages, and the chunk that contains them; see `McapWriter.add_channel`.

        With `auto`, messages are compressed with zstd unless they are compressed already. Large ones get chunks of
        their own.
        """
        size = ":large" if self.type in _LARGE | _COMPRESSED else ""
        if compression == "auto":
            compression = "none" if self.type in _COMPRESSED else "zstd"
        return f"{'' if compression == 'none' else compression}{size}"


def qos_text(qos: QoS) -> str:
    """Returns a quality of service as bags of version 8 contain it."""
    profile = {
        "history": _KEEP_LAST,
        "depth": qos.depth,
        "reliability": _RELIABILITY[qos.reliability],
        "durability": _DURABILITY[qos.durability],
        "deadline": _FOREVER,
        "lifespan": _FOREVER,
        "liveliness": _AUTOMATIC,
        "liveliness_lease_duration": _FOREVER,
        "avoid_ros_namespace_conventions": False,
    }
    text: str = yaml.dump([profile], sort_keys=False, Dumper=_NoAliases)
    return text.strip()


def qos_from(profiles: Any) -> QoS:
    """Returns the quality of service in a bag of any version; the default one if it cannot be read."""
    try:
        parsed = yaml.safe_load(profiles) if isinstance(profiles, str) else profiles
        first = parsed[0]
        latched = str(first["durability"]).lower() in ("1", "transient_local")
        best_effort = str(first["reliability"]).lower() in ("2", "best_effort")
        return QoS(
            depth=max(1, int(first["depth"])),
            reliability="best_effort" if best_effort else "reliable",
            durability="transient_local" if latched else "volatile",
        )
    except (yaml.YAMLError, KeyError, IndexError, TypeError, ValueError):
        return DEFAULT


class _NoAliases(yaml.SafeDumper):
    """Writes equal values again, because not every reader of bags knows the aliases of YAML."""

    def ignore_aliases(self, data: Any) -> bool:
        """Returns that no aliases are wanted."""
        return True
