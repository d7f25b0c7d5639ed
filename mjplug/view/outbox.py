"""What waits for one page, and how much of it may be on its way.

Items wait in slots. A batch contains everything that waits, and at most `WINDOW` batches are on their way, so a slow
page gets fewer items instead of a growing queue.
"""

import struct
from collections import deque
from collections.abc import Callable, Sequence
from typing import Final

WINDOW: Final = 2
"""Maximum number of batches that the page has not acknowledged."""

MAX_SAMPLES: Final = 1000
"""Maximum number of samples in the slot of a channel; the oldest are dropped."""

MAX_BYTES: Final = 16 << 20
"""Maximum total size of the samples in the slot of a channel [bytes]; one sample is always kept."""

FRAME: Final = 1
OVERLAY: Final = 2
SAMPLES: Final = 3
IMAGE: Final = 4

_HEADER = struct.Struct("<BBHIQ")
"""Kind, id of the server, channel, batch, zero."""

_SAMPLE = struct.Struct("<II")
"""Length of the sample [bytes], number of samples that were dropped before it."""

_ALIGNMENT = 8


class Slot:
    """The items of one kind and channel that wait for the page.

    Args:
        kind: `FRAME`, `OVERLAY`, `SAMPLES` or `IMAGE`.
        server: Id of the server; 0 for topics.
        channel: Number of the channel; for overlays the index of the kind.
    """

    def __init__(self, kind: int, server: int = 0, channel: int = 0) -> None:
        self.kind = kind
        self.server = server
        self.channel = channel

    def encode(self, batch: int) -> bytes:
        """Returns what waits as one item, and empties the slot."""
        return _HEADER.pack(self.kind, self.server, self.channel, batch, 0) + self._take()

    def clear(self) -> None:
        """Drops what waits."""

    def _take(self) -> bytes:
        raise NotImplementedError


class NewestSlot(Slot):
    """Keeps the newest payload only."""

    _payload = b""

    def put(self, payload: bytes) -> None:
        """Replaces what waits."""
        self._payload = payload

    def clear(self) -> None:
        """Drops what waits."""
        self._payload = b""

    def _take(self) -> bytes:
        payload, self._payload = self._payload, b""
        return payload


class SampleSlot(Slot):
    """Keeps the newest samples of a topic, and counts those that are dropped.

    Args:
        channel: Number of the channel.
        limit: Maximum number of samples.
    """

    def __init__(self, channel: int, limit: int) -> None:
        super().__init__(SAMPLES, channel=channel)
        self._limit = limit
        self._samples: deque[tuple[bytes, int]] = deque()
        self._bytes = 0

    def add(self, payloads: Sequence[bytes], lost: int) -> None:
        """Adds samples.

        Args:
            payloads: The samples.
            lost: Number of samples that were dropped before the first of them.
        """
        for payload in payloads:
            self._samples.append((payload, lost))
            self._bytes += len(payload)
            lost = 0
            while len(self._samples) > self._limit or (self._bytes > MAX_BYTES and len(self._samples) > 1):
                dropped, before = self._samples.popleft()
                self._bytes -= len(dropped)
                following, earlier = self._samples[0]
                self._samples[0] = following, earlier + before + 1

    def clear(self) -> None:
        """Drops what waits."""
        self._samples.clear()
        self._bytes = 0

    def _take(self) -> bytes:
        parts: list[bytes] = []
        for payload, lost in self._samples:
            parts += (_SAMPLE.pack(len(payload), lost), payload, bytes(-len(payload) % _ALIGNMENT))
        self.clear()
        return b"".join(parts)


class Outbox:
    """The items that wait for one page.

    Args:
        wake: Called when `take` may return something.
    """

    def __init__(self, wake: Callable[[], None]) -> None:
        self._wake = wake
        self._ready: dict[Slot, None] = {}
        self._sent = 0
        self._acknowledged = 0

    @property
    def blocked(self) -> bool:
        """Whether something waits that the page must not get before it acknowledges a batch."""
        return bool(self._ready) and self._sent - self._acknowledged >= WINDOW

    def fill(self, slot: Slot) -> None:
        """Notes that a slot contains something."""
        self._ready[slot] = None
        self._wake()

    def discard(self, slot: Slot) -> None:
        """Drops what waits in a slot."""
        slot.clear()
        self._ready.pop(slot, None)

    def take(self) -> list[bytes]:
        """Returns the next batch; empty if nothing waits, or if too many batches are on their way."""
        if not self._ready or self.blocked:
            return []
        self._sent += 1
        batch = self._sent & 0xFFFFFFFF
        slots, self._ready = self._ready, {}
        return [slot.encode(batch) for slot in slots]

    def acknowledge(self, batch: int) -> None:
        """Notes that the page has drawn all batches up to this one."""
        self._acknowledged = max(self._acknowledged, min(batch, self._sent))
        if self._ready:
            self._wake()
