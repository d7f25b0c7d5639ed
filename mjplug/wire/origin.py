"""The attachment of every message on a plain key: sequence number, times, epoch and source.

The first 33 bytes are those of rmw_zenoh. Simulated time and epoch follow, because most types have no header, and a
subscriber could not know to which instant such a message belongs.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass
from struct import Struct
from time import time_ns

import xxhash
import zenoh

_RMW = Struct("<qqB16s")
_LAYOUT = Struct("<qqB16sqI")
_GID_SIZE = 16
_HOST_SIZE = 8

SIZE = _LAYOUT.size
"""Size of the attachment [bytes]."""

UNKNOWN_TIME = -1
"""The simulated time in the attachment of a publisher that does not know it, such as a client."""

Now = Callable[[], tuple[int, int]]
"""Returns the simulated time [ns], and the number of resets and restored states."""

_MAX_SOURCES = 1024
"""Maximum number of publishers of one topic whose sequence numbers are followed; any program can invent sources."""


def no_time() -> tuple[int, int]:
    """Returns that the simulated time is unknown; a `Now`."""
    return UNKNOWN_TIME, 0


@dataclass(frozen=True, slots=True)
class Origin:
    """A decoded attachment.

    Attributes:
        sequence_number: Number of the message on its key among those of its publisher, from 1.
        source_timestamp: Wall time at which it was sent [ns since 1970].
        gid: Id of the publisher, 16 bytes. The first 8 bytes are those of all publishers of one server.
        time_ns: Simulated time at which it was published [ns]; None if the publisher does not know it.
        epoch: Number of resets and restored states at that time; None if the publisher does not know it.
    """

    sequence_number: int
    source_timestamp: int
    gid: bytes
    time_ns: int | None = None
    epoch: int | None = None

    @property
    def host(self) -> bytes:
        """The part of the gid that all publishers of one server, of one client or of one ROS 2 publisher share."""
        return self.gid[:_HOST_SIZE]


def origin_of(attachment: zenoh.ZBytes | None) -> Origin | None:
    """Returns the content of an attachment; None if there is none, or one of another format.

    The attachment of rmw_zenoh, which contains no simulated time, is accepted too.
    """
    return None if attachment is None else decode(attachment.to_bytes())


def decode(raw: bytes) -> Origin | None:
    """Returns the content of an attachment; None if it has another format. Bytes after the known ones are ignored."""
    if len(raw) == _RMW.size and raw[16] == _GID_SIZE:
        sequence_number, sent, _, gid = _RMW.unpack(raw)
        return Origin(sequence_number, sent, gid)
    if len(raw) < SIZE or raw[16] != _GID_SIZE:
        return None
    sequence_number, sent, _, gid, simulated, epoch = _LAYOUT.unpack_from(raw)
    if simulated < 0:
        return Origin(sequence_number, sent, gid)
    return Origin(sequence_number, sent, gid, simulated, epoch)


def host_id(session: zenoh.Session, name: str) -> bytes:
    """Returns the first half of the gids of a program: equal for its publishers, different after a restart.

    Args:
        session: The session of the program.
        name: Name of the program, such as the full name of the server.
    """
    return xxhash.xxh3_64_digest(f"{session.zid()}{name}".encode())


class Attachments:
    """Generates the attachments of one publisher on one key.

    A subscriber interprets a gap in the sequence numbers as lost messages, so call `next` only for sent messages.

    Attributes:
        host: As below.

    Args:
        host: First half of the gid; see `host_id`. The second half is random, so that a publisher that starts again
            has another gid, because its sequence numbers start again too.
        now: Returns the simulated time and the epoch.
    """

    def __init__(self, host: bytes, now: Now) -> None:
        self.host = host
        self._now = now
        self._gid = host + os.urandom(_GID_SIZE - _HOST_SIZE)
        self._count = 0

    def next(self) -> bytes:
        """Returns the attachment of the next message, which must be sent now."""
        self._count += 1
        simulated, epoch = self._now()
        return _LAYOUT.pack(self._count, time_ns(), _GID_SIZE, self._gid, simulated, epoch)


class Gaps:
    """Counts the messages of one topic that were sent but did not arrive.

    Attributes:
        lost: Number of lost messages.
        known: Whether a message with a sequence number has arrived. If not, lost messages cannot be counted.
    """

    def __init__(self) -> None:
        self.lost = 0
        self.known = False
        self._last: dict[bytes, int] = {}

    def count(self, origin: Origin | None) -> int:
        """Follows the sequence numbers of one publisher; returns how many messages are missing before this one.

        A publisher's first message starts its count. A message that is older than the last one was repeated from the
        history of a latched topic, and changes nothing.
        """
        if origin is None:
            return 0
        self.known = True
        last = self._last.get(origin.gid)
        if last is None:
            if len(self._last) >= _MAX_SOURCES:
                del self._last[next(iter(self._last))]
            self._last[origin.gid] = origin.sequence_number
            return 0
        if origin.sequence_number <= last:
            return 0
        self._last[origin.gid] = origin.sequence_number
        missing = origin.sequence_number - last - 1
        self.lost += missing
        return missing
