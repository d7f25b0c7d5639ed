"""The 33-byte attachment of every message, request and response: sequence number, time and sender.

Nodes drop a message without an attachment. An attachment of another format may crash a node.
"""

from dataclasses import dataclass, replace
from struct import Struct
from time import time_ns

_LAYOUT = Struct("<qqB16s")
_GID_SIZE = 16

SIZE = _LAYOUT.size


@dataclass(frozen=True, slots=True)
class Attachment:
    """A decoded attachment.

    Attributes:
        sequence_number: Number of the message of its publisher, or of the request of its client, from 1.
        source_timestamp: Time of sending [ns since 1970, wall clock].
        gid: Id of the sender, 16 bytes; in a response, id of the client that sent the request.
    """

    sequence_number: int
    source_timestamp: int
    gid: bytes

    @classmethod
    def from_bytes(cls, raw: bytes) -> "Attachment":
        """Decodes an attachment.

        Raises:
            ValueError: The bytes are not a valid attachment.
        """
        if len(raw) != SIZE or raw[16] != _GID_SIZE:
            raise ValueError(
                f"the attachment has {len(raw)} bytes ({raw[:20].hex(' ')} ...); an attachment of rmw_zenoh has {SIZE} "
                f"since 0.1.2 (Humble), 0.2.4 (Jazzy) and 0.6.0; byte 16 is the length of the gid, {_GID_SIZE}"
            )
        sequence_number, source_timestamp, _, gid = _LAYOUT.unpack(raw)
        return cls(sequence_number, source_timestamp, gid)

    def to_bytes(self) -> bytes:
        """Returns the encoded attachment."""
        return _LAYOUT.pack(self.sequence_number, self.source_timestamp, _GID_SIZE, self.gid)

    def of_response(self) -> "Attachment":
        """Returns the attachment of the response to this request, by which the client identifies its request."""
        return replace(self, source_timestamp=time_ns())


class Attachments:
    """Generates the attachments of one publisher.

    A subscription interprets a gap in the sequence numbers as lost messages, so call `next` only for sent messages.
    """

    def __init__(self, gid: bytes) -> None:
        self._gid = gid
        self._count = 0

    def next(self) -> bytes:
        """Returns the attachment of the next message, which must be sent now."""
        self._count += 1
        return _LAYOUT.pack(self._count, time_ns(), _GID_SIZE, self._gid)
