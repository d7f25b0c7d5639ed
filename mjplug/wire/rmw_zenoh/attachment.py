"""The 33 bytes that go with every message, request and response: who sent it, when, and which one it is.

Nodes drop a message without them, and one with other bytes may bring a node down.
"""

from dataclasses import dataclass, replace
from struct import Struct
from time import time_ns

_LAYOUT = Struct("<qqB16s")
_GID_SIZE = 16

SIZE = _LAYOUT.size


@dataclass(frozen=True, slots=True)
class Attachment:
    """An attachment, taken apart.

    Attributes:
        sequence_number: Counts the messages of a publisher, or the requests of a client, from 1.
        source_timestamp: When it was sent [ns since 1970, wall clock].
        gid: Who sent it; in a response, who asked.
    """

    sequence_number: int
    source_timestamp: int
    gid: bytes

    @classmethod
    def from_bytes(cls, raw: bytes) -> "Attachment":
        """Takes an attachment apart.

        Raises:
            ValueError: These bytes are none.
        """
        if len(raw) != SIZE or raw[16] != _GID_SIZE:
            raise ValueError(
                f"the attachment has {len(raw)} bytes ({raw[:20].hex(' ')} ...); rmw_zenoh's has {SIZE} since 0.1.2 "
                f"(Humble), 0.2.4 (Jazzy) and 0.6.0, with the length {_GID_SIZE} before the last {_GID_SIZE}"
            )
        sequence_number, source_timestamp, _, gid = _LAYOUT.unpack(raw)
        return cls(sequence_number, source_timestamp, gid)

    def to_bytes(self) -> bytes:
        """Returns the bytes."""
        return _LAYOUT.pack(self.sequence_number, self.source_timestamp, _GID_SIZE, self.gid)

    def of_response(self) -> "Attachment":
        """Returns what goes with the response to this request: the client finds its request again by it."""
        return replace(self, source_timestamp=time_ns())


class Attachments:
    """The attachments of one publisher, in the order of what it sends.

    A subscription takes a gap in the numbers for lost messages, so only what is really sent may be counted.
    """

    def __init__(self, gid: bytes) -> None:
        self._gid = gid
        self._count = 0

    def next(self) -> bytes:
        """Returns the attachment of the next message, which is sent now."""
        self._count += 1
        return _LAYOUT.pack(self._count, time_ns(), _GID_SIZE, self._gid)
