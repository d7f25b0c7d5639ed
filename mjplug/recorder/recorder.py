"""Records topics: Zenoh's threads put messages into the backlog, and the thread that calls `turn` writes them."""

import logging
import struct
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import zenoh
from zenoh.ext import HistoryConfig, declare_advanced_subscriber
from zenoh.handlers import Callback

from mjplug.bag.definitions import class_of
from mjplug.bag.topics import BagTopic
from mjplug.bag.writer import BagWriter, Record, counts_text
from mjplug.recorder.backlog import Backlog
from mjplug.recorder.lives import Lives
from mjplug.recorder.selection import Selection
from mjplug.recorder.sources import Source, Sources
from mjplug.wire.origin import Gaps, Origin, origin_of
from mjplug_schemas.errors import CodecError

_log = logging.getLogger(__name__)

CLOCK = "rosgraph_msgs/msg/Clock"
FLUSH_INTERVAL = 1.0
"""Wall time after which messages are in the file at the latest [s]; a killed recorder loses no more."""

SYNC_INTERVAL = 5.0
"""Wall time after which messages are on the disk at the latest [s]; a power failure costs no more."""

_LATE = 1.0
"""How long messages from before a reset are written to the file before [s]."""

_STAMP = struct.Struct("<iI")

ClockKind = Literal["sim", "wall"]


@dataclass(slots=True)
class Recorded:
    """A topic that is recorded.

    Attributes:
        source: The topic.
        wanted: Whether it is written; otherwise it is only read for its time.
        written: Number of messages in the bag.
        dropped: Number of messages that arrived while the backlog was full.
        unreadable: Number of messages that are not of its type.
        gaps: The messages that were sent but did not arrive.
    """

    source: Source
    wanted: bool
    written: int = 0
    dropped: int = 0
    unreadable: int = 0
    gaps: Gaps = field(default_factory=Gaps)

    @property
    def topic(self) -> BagTopic:
        """The topic."""
        return self.source.topic


@dataclass(frozen=True, slots=True)
class _Arrival:
    recorded: Recorded
    sample: zenoh.Sample
    origin: Origin | None
    wall_ns: int


class Recorder:
    """Records the selected topics of a network into a bag.

    Attributes:
        topics: The topics that are recorded, by name.
        backlog: The messages that wait.
        bag: The bag.
        paused: Whether arriving messages are ignored.

    Args:
        session: The session of a client.
        bag: The bag.
        selection: The topics.
        clock: Whether log times are simulated or wall time.
        max_backlog: Maximum size of the messages that wait [bytes].
        notice: Called with a sentence for the user.
    """

    def __init__(
        self,
        session: zenoh.Session,
        bag: BagWriter,
        selection: Selection,
        clock: ClockKind,
        max_backlog: int,
        notice: Callable[[str], None],
    ) -> None:
        self.topics: dict[str, Recorded] = {}
        self.backlog: Backlog[_Arrival] = Backlog(max_backlog)
        self.bag = bag
        self.paused = False
        self._session = session
        self._selection = selection
        self._clock = clock
        self._notice = notice
        # Wall time that no change of the system's clock moves.
        self._wall_offset = time.time_ns() - time.monotonic_ns()
        self._began_ns = time.time_ns()
        self._time_ns = 0
        self._declared: list[Any] = []
        self._lock = threading.Lock()
        self._timed = threading.Event()
        now = time.monotonic()
        self._flushed, self._synced, self._part_began = now, now, now
        self._warned: set[str] = set()
        self.sources = Sources(session, self._found)
        self._lives = Lives(self.sources.server_of)
        bag.describe({"clock": clock})

    def wait_for_time(self, timeout: float) -> bool:
        """Waits until the servers have been asked for their topics, and simulated time is known if it is needed.

        Args:
            timeout: How long to wait [s].

        Returns:
            Whether it is known.
        """
        until = time.monotonic() + timeout
        self.sources.known.wait(timeout)
        if self._clock == "sim":
            self._timed.wait(max(0.0, until - time.monotonic()))
            return self._timed.is_set()
        return True

    def turn(self, timeout: float = 0.1) -> None:
        """Writes messages that have arrived, and does what is due.

        Args:
            timeout: How long to wait for messages [s].

        Raises:
            BagError: The disk is full, or fails.
        """
        for arrival in self.backlog.take(timeout):
            self._write(arrival)
        now = time.monotonic()
        if now - self._part_began >= _LATE:
            self.bag.end_previous()
        if now - self._flushed >= FLUSH_INTERVAL:
            sync = now - self._synced >= SYNC_INTERVAL
            self.bag.flush(sync)
            self._flushed = time.monotonic()
            if sync:
                self._synced = self._flushed

    def stop(self) -> None:
        """Ends the subscriptions; waiting messages can still be written. A second call does nothing."""
        self.sources.close()
        with self._lock:
            declared, self._declared = self._declared, []
        for subscriber in declared:
            subscriber.undeclare()

    def finish(self) -> None:
        """Completes the bag with what has been written.

        Raises:
            BagError: The disk fails.
        """
        self.bag.finish(self.summary())

    def summary(self) -> dict[str, str]:
        """Returns what was lost, for the metadata record of the last file."""
        # Copied, because another thread adds topics.
        wanted = {name: topic for name, topic in tuple(self.topics.items()) if topic.wanted}
        return {
            "lost": counts_text({name: topic.gaps.lost for name, topic in wanted.items()}),
            "dropped": counts_text({name: topic.dropped for name, topic in wanted.items()}),
            "unreadable": counts_text({name: topic.unreadable for name, topic in wanted.items()}),
        }

    def missing(self) -> list[str]:
        """Returns the names of selected topics that no server has."""
        return self._selection.missing(tuple(self.topics))

    def total(self, what: Literal["written", "dropped", "unreadable", "lost"]) -> int:
        """Returns a number over all topics."""
        topics = [topic for topic in tuple(self.topics.values()) if topic.wanted]
        if what == "lost":
            return sum(topic.gaps.lost for topic in topics)
        return sum(int(getattr(topic, what)) for topic in topics)

    def _found(self, source: Source) -> None:
        name = source.topic.name
        wanted = name in self._selection
        if not wanted and (self._clock != "sim" or source.topic.type != CLOCK):
            return
        known = self.topics.get(name)
        if known is not None:
            if known.topic.type != source.topic.type and name not in self._warned:
                self._warned.add(name)
                self._notice(
                    f"{name} is recorded as {known.topic.type}; a server now has it as {source.topic.type}, "
                    "which is not recorded"
                )
            return
        recorded = self.topics[name] = Recorded(source, wanted)
        if wanted:
            self.bag.add_topic(source.topic)
        for key in source.keys:
            self._subscribe(recorded, key)

    def _subscribe(self, recorded: Recorded, key: str) -> None:
        def receive(sample: zenoh.Sample) -> None:
            if sample.kind != zenoh.SampleKind.PUT or self.paused:
                return
            wall_ns = self._wall_offset + time.monotonic_ns()
            origin = origin_of(sample.attachment)
            # Here, because a message for which there is no room has arrived and is no gap.
            recorded.gaps.count(origin)
            if not self._timed.is_set():
                self._follow_time(recorded, origin, sample.payload.to_bytes())
            if not self.backlog.put(_Arrival(recorded, sample, origin, wall_ns), len(sample.payload)):
                recorded.dropped += 1

        handler, topic = Callback(receive, indirect=False), recorded.topic
        with self._lock:
            if topic.latched:
                history = HistoryConfig(detect_late_publishers=True, max_samples=topic.qos.depth)
                self._declared.append(declare_advanced_subscriber(self._session, key, handler, history=history))
            else:
                self._declared.append(self._session.declare_subscriber(key, handler))

    def _write(self, arrival: _Arrival) -> None:
        recorded, origin = arrival.recorded, arrival.origin
        data = self._cdr(recorded, arrival.sample)
        if data is None:
            return
        self._follow_time(recorded, origin, data)
        if not recorded.wanted:
            return
        # A latched message may be older than the present life of its server.
        why, late = ("", False) if recorded.topic.latched else self._lives.check(origin)
        if why:
            self.bag.begin_part(self._about(why), forget="started again" in why)
            self._part_began = time.monotonic()
            self._notice(f"{why}: the bag continues in a new file")
        log_time, publish_time = self._times(arrival, origin)
        number, gid = (0, b"") if origin is None else (origin.sequence_number, origin.gid)
        self.bag.write(Record(recorded.topic.name, log_time, publish_time, number, data, gid), late)
        recorded.written += 1

    def _about(self, why: str) -> Mapping[str, str]:
        return {"clock": self._clock, "epoch": self._lives.text, "begins because": why}

    def _times(self, arrival: _Arrival, origin: Origin | None) -> tuple[int, int]:
        """Returns log time and publish time of a message [ns]."""
        # Any program can send an attachment with a negative time, which a bag cannot contain.
        sent = arrival.wall_ns if origin is None else max(0, origin.source_timestamp)
        if self._clock == "wall":
            return arrival.wall_ns, sent
        # The history of a latched topic may be from long before; in the bag it is at the beginning.
        old = arrival.recorded.topic.latched and sent < self._began_ns
        if old or origin is None or origin.time_ns is None:
            return self._time_ns, sent
        return origin.time_ns, sent

    def _follow_time(self, recorded: Recorded, origin: Origin | None, data: bytes) -> None:
        if origin is not None and origin.time_ns is not None and not recorded.topic.latched:
            self._time_ns = origin.time_ns
        elif recorded.topic.type == CLOCK and len(data) >= 12 and data[1] == 1:
            # A server that sends no attachments.
            sec, nanosec = _STAMP.unpack_from(data, 4)
            self._time_ns = max(0, sec * 1_000_000_000 + nanosec)
        else:
            return
        self._timed.set()

    def _cdr(self, recorded: Recorded, sample: zenoh.Sample) -> bytes | None:
        """Returns a message in CDR; None if it is not one."""
        data = sample.payload.to_bytes()
        if data[:2] in (b"\0\0", b"\0\1"):
            return data
        if data.lstrip()[:1] == b"{":
            topic = recorded.topic
            try:
                converted: bytes = class_of(topic.type, topic.definition).from_json(data).to_cdr()
                return converted
            except CodecError as error:
                _log.debug("topic %s: %s", topic.name, error)
        recorded.unreadable += 1
        return None
