"""Writes a bag: a folder with one or more MCAP files and `metadata.yaml`, in the layout of rosbag2."""

import errno
import json
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path

from mjplug.bag.errors import BagError
from mjplug.bag.mcap_writer import McapWriter
from mjplug.bag.metadata import OPEN, FileInfo, metadata_text, write_metadata
from mjplug.bag.topics import BagTopic, Compression

RECORD = "mjplug"
"""Name of the metadata record at the beginning of a file: time axis, epochs, and why the file begins."""

END_RECORD = "mjplug_end"
"""Name of the metadata record at its end: what was lost."""

_MAX_LATCHED_SOURCES = 256
"""Maximum number of publishers of latched topics whose messages are repeated in each file."""

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


@dataclass(frozen=True, slots=True)
class Limits:
    """When a new file begins.

    Attributes:
        bytes: Size of a file [bytes]; 0 means no limit.
        duration_ns: Length of a file in log time [ns]; 0 means no limit.
    """

    bytes: int = 0
    duration_ns: int = 0


@dataclass(frozen=True, slots=True)
class Record:
    """A message to write.

    Attributes:
        topic: Full name of its topic.
        log_time: Time at which it is in the bag [ns].
        publish_time: Wall time at which it was sent [ns].
        sequence: Its sequence number; 0 if unknown.
        data: The message in CDR.
        source: Id of its publisher.
    """

    topic: str
    log_time: int
    publish_time: int
    sequence: int
    data: bytes
    source: bytes = b""


@dataclass(slots=True)
class _File:
    """A file that is being written."""

    mcap: McapWriter
    result: dict[str, str] = field(default_factory=dict)
    channels: dict[str, int] = field(default_factory=dict)
    start: int | None = None

    def info(self) -> FileInfo:
        """Returns what is on the disk."""
        counts = self.mcap.counts
        start, end = self.mcap.span or (0, 0)
        by_topic = {topic: counts.get(channel, 0) for topic, channel in self.channels.items()}
        return FileInfo(self.mcap.path.name, start, end, by_topic)


class BagWriter:
    """Writes a new bag.

    Attributes:
        folder: The folder of the bag.
        size: Number of bytes in its finished files.

    Args:
        folder: A folder that does not exist; missing parent folders are created.
        compression: How messages are compressed.
        limits: When a new file begins.
        custom: Custom data for `metadata.yaml`.

    Raises:
        BagError: The folder exists or cannot be created.
    """

    def __init__(
        self,
        folder: Path,
        compression: Compression = "auto",
        limits: Limits | None = None,
        custom: Mapping[str, str] | None = None,
    ) -> None:
        self.folder = folder
        self.size = 0
        self._compression = compression
        self._limits = limits or Limits()
        self._custom = {"mjplug_version": version("mjplug"), **(custom or {})}
        self._topics: dict[str, BagTopic] = {}
        self._files: list[FileInfo] = []
        self._count = 0
        self._current: _File | None = None
        self._previous: _File | None = None
        self._about: dict[str, str] = {}
        self._attachments: list[tuple[str, str, bytes]] = []
        self._latched: dict[tuple[str, bytes], deque[Record]] = {}
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            raise BagError(f"{folder} already exists; choose another name with --output, or remove it") from None
        except OSError as error:
            raise BagError(f"cannot create {folder}: {error.strerror}") from None
        try:
            self._write_metadata(opened=True)
        except OSError as error:
            raise BagError(f"cannot write into {folder}: {error.strerror}") from None

    @property
    def files(self) -> int:
        """Number of files that were begun."""
        return self._count

    @property
    def total_size(self) -> int:
        """Number of bytes in all files, with the messages that are not written yet."""
        parts = (file.mcap for file in (self._current, self._previous) if file is not None)
        return self.size + sum(part.size + part.pending for part in parts)

    def add_topic(self, topic: BagTopic) -> None:
        """Adds a topic, which may have no messages."""
        self._topics.setdefault(topic.name, topic)

    def write(self, record: Record, late: bool = False) -> None:
        """Writes a message of an added topic.

        Args:
            record: The message.
            late: Whether it belongs to the file before, if that is still open.

        Raises:
            BagError: The disk is full, or fails.
        """
        try:
            if late and self._previous is not None:
                self._put(self._previous, record)
                return
            self._split_if_due(record.log_time)
            file = self._current or self._begin(record)
            self._put(file, record)
        except OSError as error:
            raise self._failed(error) from error
        if self._topics[record.topic].latched:
            self._keep(record)

    def begin_part(self, about: Mapping[str, str], forget: bool = False) -> None:
        """Lets the next message begin a new file.

        Late messages of the file before are accepted until `end_previous`.

        Args:
            about: What the metadata record of the new file contains.
            forget: Whether latched messages are not repeated, because their server has ended.

        Raises:
            BagError: The disk is full, or fails.
        """
        self.end_previous()
        self._about = dict(about)
        if forget:
            self._latched.clear()
        self._previous, self._current = self._current, None

    def end_previous(self) -> None:
        """Finishes the file before the present one.

        Raises:
            BagError: The disk is full, or fails.
        """
        previous, self._previous = self._previous, None
        if previous is not None:
            self._end(previous)

    def flush(self, sync: bool = False) -> None:
        """Writes all messages to the files.

        Args:
            sync: Whether to wait until the disk has stored them.

        Raises:
            BagError: The disk is full, or fails.
        """
        try:
            for file in (self._previous, self._current):
                if file is not None:
                    file.mcap.flush(sync)
        except OSError as error:
            raise self._failed(error) from error

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Adds an attachment to the present file, or to the next one if there is none.

        Raises:
            BagError: The disk is full, or fails.
        """
        if self._current is None:
            self._attachments.append((name, media_type, data))
            return
        try:
            self._current.mcap.add_attachment(name, media_type, data)
        except OSError as error:
            raise self._failed(error) from error

    def describe(self, about: Mapping[str, str]) -> None:
        """Sets what the metadata record of the next file contains."""
        self._about = dict(about)

    def finish(self, result: Mapping[str, str] | None = None) -> None:
        """Completes the bag. If the disk is full, the last messages are removed until the rest can be completed.

        Args:
            result: Content of the metadata record at the end of the last file.

        Raises:
            BagError: The disk fails.
        """
        if self._current is not None:
            self._current.result |= result or {}
        self.end_previous()
        current, self._current = self._current, None
        if current is not None:
            self._end(current, last=True)
        else:
            self._write_last(None)

    def _put(self, file: _File, record: Record) -> None:
        channel = file.channels.get(record.topic)
        if channel is None:
            topic = self._topics[record.topic]
            group = topic.group(self._compression)
            channel = file.mcap.add_channel(topic.name, topic.type, topic.definition, topic.channel_metadata, group)
            file.channels[record.topic] = channel
        if file.start is None:
            file.start = record.log_time
        file.mcap.write(channel, record.log_time, record.publish_time, record.sequence, record.data)

    def _begin(self, first: Record) -> _File:
        path = self.folder / f"{self.folder.resolve().name}_{self._count}.mcap"
        mcap = McapWriter(path, f"mjplug {version('mjplug')}")
        file = self._current = _File(mcap)
        self._count += 1
        self._write_metadata(opened=True)
        repeated = [record for kept in self._latched.values() for record in kept]
        mcap.add_metadata(RECORD, self._about | {"repeated": str(len(repeated))})
        for attachment in self._attachments:
            mcap.add_attachment(*attachment)
        self._attachments.clear()
        for record in repeated:
            self._put(file, _at(record, first.log_time))
        return file

    def _split_if_due(self, log_time: int) -> None:
        file = self._current
        if file is None or file.start is None:
            return
        full = 0 < self._limits.bytes <= file.mcap.size + file.mcap.pending
        long = 0 < self._limits.duration_ns <= log_time - file.start
        if full or long:
            self._current = None
            self._end(file)

    def _keep(self, record: Record) -> None:
        key = (record.topic, record.source)
        if key not in self._latched:
            if len(self._latched) >= _MAX_LATCHED_SOURCES:
                del self._latched[next(iter(self._latched))]
            self._latched[key] = deque(maxlen=self._topics[record.topic].qos.depth)
        self._latched[key].append(record)

    def _end(self, file: _File, last: bool = False) -> None:
        """Finishes a file; on a full disk, with as many of its chunks as fit."""
        cut = False
        while True:
            try:
                file.mcap.add_metadata(END_RECORD, file.result | ({"cut": "the disk was full"} if cut else {}))
                info = file.info()
                topics = [topic for topic in tuple(self._topics.values()) if topic.name in file.channels]
                text = metadata_text(topics, [info], self._custom)
                file.mcap.add_metadata("rosbag2", {"serialized_metadata": text})
                file.mcap.finish()
                file.mcap.sync()
                self._write_metadata(opened=not last, ending=file)
                break
            except OSError as error:
                if error.errno not in _FULL or not file.mcap.drop_last_chunk():
                    file.mcap.close()
                    raise self._failed(error) from error
                cut = True
        file.mcap.close()
        self._files.append(file.info())
        self.size += file.mcap.size
        if cut and not last:
            raise BagError(f"the disk of {self.folder} is full")

    def _write_last(self, ending: _File | None) -> None:
        try:
            self._write_metadata(opened=False, ending=ending)
        except OSError as error:
            raise self._failed(error) from error

    def _write_metadata(self, opened: bool, ending: _File | None = None) -> None:
        files = [*self._files, *(file.info() for file in (ending, self._previous, self._current) if file is not None)]
        custom = self._custom | ({OPEN: "true"} if opened else {})
        write_metadata(self.folder, metadata_text([*self._topics.values()], files, custom))

    def _failed(self, error: OSError) -> BagError:
        if error.errno in _FULL:
            return BagError(f"the disk of {self.folder} is full")
        return BagError(f"cannot write the bag {self.folder}: {error.strerror}")


def _at(record: Record, log_time: int) -> Record:
    return Record(record.topic, log_time, record.publish_time, record.sequence, record.data, record.source)


def counts_text(counts: Mapping[str, int]) -> str:
    """Returns numbers by topic as text for a metadata record; topics with 0 are left out."""
    return json.dumps({name: count for name, count in sorted(counts.items()) if count})
