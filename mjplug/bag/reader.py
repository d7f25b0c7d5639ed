"""Reads bags: a folder of rosbag2 with MCAP files, or one MCAP file, finished, split or damaged."""

import heapq
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
import zstandard
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Attachment, Channel, Chunk, Footer, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from mjplug.bag import metadata
from mjplug.bag.errors import BagError
from mjplug.bag.topics import BagTopic, qos_from
from mjplug.bag.writer import END_RECORD, RECORD

READ_ERRORS = (
    McapError, zstandard.ZstdError, struct.error,
    ValueError, EOFError, OSError, RuntimeError, KeyError, IndexError, MemoryError,
)  # fmt: skip
"""What mcap and the libraries for compression raise for damaged files."""


@dataclass(frozen=True, slots=True)
class BagMessage:
    """A message in a bag.

    Attributes:
        topic: Its topic.
        log_time: Its time in the bag [ns].
        publish_time: When it was sent [ns].
        sequence: Lowest 32 bits of its sequence number; 0 if unknown.
        data: The message in CDR.
        file: Index of its file in the bag.
    """

    topic: BagTopic
    log_time: int
    publish_time: int
    sequence: int
    data: bytes
    file: int = 0


@dataclass(slots=True)
class BagFile:
    """What one file of a bag contains.

    Attributes:
        path: The file.
        topics: The topics by channel id.
        counts: Number of messages by channel id.
        start: First log time [ns].
        end: Last log time [ns].
        about: The metadata record at its beginning; empty if there is none.
        result: The metadata record at its end; empty if there is none.
        compressed: Sizes of the chunks before and after compression [bytes], by compression.
        attachments: Names and sizes of the attachments [bytes].
        finished: Whether it has an index. If not, it was read from the beginning as far as possible.
        damage: Why it could not be read further; empty if it is whole.
    """

    path: Path
    topics: dict[int, BagTopic] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    start: int = 0
    end: int = 0
    about: Mapping[str, str] = field(default_factory=dict)
    result: Mapping[str, str] = field(default_factory=dict)
    compressed: dict[str, tuple[int, int]] = field(default_factory=dict)
    attachments: dict[str, int] = field(default_factory=dict)
    finished: bool = True
    damage: str = ""

    @property
    def messages(self) -> int:
        """Number of messages."""
        return sum(self.counts.values())


class Bag:
    """A bag that is read.

    Attributes:
        path: The folder or file.
        files: Its MCAP files, in the order of recording.
        custom: Custom data in `metadata.yaml`.
        has_metadata: Whether there is a `metadata.yaml` that can be read.

    Args:
        path: A folder with MCAP files, or one MCAP file.

    Raises:
        BagError: There is no such bag.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.custom: dict[str, str] = {}
        self.has_metadata = False
        if path.is_file():
            self.files = [path]
            return
        if not path.is_dir():
            raise BagError(f"there is no bag {path}")
        listed = self._listed()
        there = sorted(path.glob("*.mcap"), key=_order)
        self.files = [*listed, *(file for file in there if file not in listed)]
        if not self.files:
            if any(path.glob("*.db3")):
                raise BagError(f"{path} is a bag with SQLite storage; only MCAP is read: ros2 bag convert makes it")
            if not self.has_metadata:
                raise BagError(f"{path} contains no MCAP file, so it is no bag")

    @property
    def open(self) -> bool:
        """Whether the bag is being recorded, or its recorder was killed."""
        return metadata.OPEN in self.custom

    def summaries(self) -> list[BagFile]:
        """Returns what each file contains; a file without an index is read from the beginning."""
        return [summary(path) for path in self.files]

    def messages(self, topics: frozenset[str] | None = None, start_ns: int | None = None) -> Iterator[BagMessage]:
        """Yields the messages of all files, one file after the other, each in the order of its log times.

        Args:
            topics: Only these topics; None for all.
            start_ns: Only messages from this log time on [ns].

        Raises:
            BagError: A file is damaged.
        """
        for index, path in enumerate(self.files):
            yield from file_messages(path, index, topics, start_ns)

    def _listed(self) -> list[Path]:
        try:
            content = yaml.safe_load((self.path / metadata.NAME).read_text(encoding="utf-8"))
            about = content["rosbag2_bagfile_information"]
            names = [str(name) for name in about["relative_file_paths"]]
            self.custom = {str(k): str(v) for k, v in (about.get("custom_data") or {}).items()}
            self.has_metadata = True
        except (OSError, ValueError, KeyError, TypeError, AttributeError, yaml.YAMLError):
            return []
        if str(about.get("compression_format") or ""):
            raise BagError(
                f"the files of {self.path} are compressed as a whole or by message "
                f"({about['compression_format']}), which is not read; decompress them with ros2 bag convert"
            )
        # A listed file must be in the folder itself.
        return [self.path / name for name in names if Path(name).name == name and (self.path / name).is_file()]


def file_messages(
    path: Path, index: int = 0, topics: frozenset[str] | None = None, start_ns: int | None = None
) -> Iterator[BagMessage]:
    """Yields the messages of a finished file in the order of their log times.

    Raises:
        BagError: The file is damaged or not finished.
    """
    known: dict[int, BagTopic] = {}
    try:
        with path.open("rb") as file:
            reader = make_reader(file)
            found = reader.iter_messages(
                topics=None if topics is None else sorted(topics), start_time=start_ns, log_time_order=True
            )
            for schema, channel, message in found:
                topic = known.get(channel.id)
                if topic is None:
                    topic = known[channel.id] = topic_of(channel, schema)
                yield BagMessage(
                    topic, message.log_time, message.publish_time, message.sequence, bytes(message.data), index
                )
    except READ_ERRORS as error:
        raise BagError(
            f"{path} is not finished or damaged ({reason(error)}); mjplug bag recover makes a bag of what can be read"
        ) from None


def summary(path: Path) -> BagFile:
    """Returns what a file contains; without an index, it is read from the beginning as far as possible."""
    found = BagFile(path)
    try:
        with path.open("rb") as file:
            reader = make_reader(file)
            content = reader.get_summary()
            if content is None or content.statistics is None:
                raise EOFError("it has no index")
            found.topics = {id: topic_of(c, content.schemas.get(c.schema_id)) for id, c in content.channels.items()}
            found.counts = dict(content.statistics.channel_message_counts)
            found.start, found.end = content.statistics.message_start_time, content.statistics.message_end_time
            for chunk in content.chunk_indexes:
                _add_sizes(found, chunk.compression, chunk.uncompressed_size, chunk.compressed_size)
            found.attachments = {index.name: index.data_size for index in content.attachment_indexes}
            for record in reader.iter_metadata():
                _add_metadata(found, record)
    except READ_ERRORS as error:
        return _scanned(path, reason(error))
    return found


def records(path: Path) -> Iterator[Any]:
    """Yields the records of a file from its beginning, those of a chunk with the checksum of the chunk verified.

    Raises:
        READ_ERRORS: The file ends or is damaged here; everything that was yielded is intact.
    """
    with path.open("rb") as file:
        for record in StreamReader(file, emit_chunks=True).records:
            if isinstance(record, Chunk):
                _check_length(record)
                yield record
                yield from breakup_chunk(record, validate_crc=True)
            else:
                yield record


def _check_length(chunk: Chunk) -> None:
    """Refuses a chunk that would fill the memory.

    Raises:
        ValueError: Its claimed size is not plausible.
    """
    if chunk.uncompressed_size > 2048 * len(chunk.data) + (1 << 20):
        raise ValueError(f"a chunk of {len(chunk.data)} bytes claims to contain {chunk.uncompressed_size}")


def _scanned(path: Path, why: str) -> BagFile:
    """Returns what a file contains as far as it can be read from the beginning."""
    found = BagFile(path, finished=False, damage=why)
    schemas: dict[int, Schema] = {}
    begun = False
    try:
        for record in records(path):
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                found.topics[record.id] = topic_of(record, schemas.get(record.schema_id))
            elif isinstance(record, Message):
                found.counts[record.channel_id] = found.counts.get(record.channel_id, 0) + 1
                found.start = min(found.start, record.log_time) if begun else record.log_time
                found.end = max(found.end, record.log_time) if begun else record.log_time
                begun = True
            elif isinstance(record, Chunk):
                _add_sizes(found, record.compression, record.uncompressed_size, len(record.data))
            elif isinstance(record, Metadata):
                _add_metadata(found, record)
            elif isinstance(record, Attachment):
                found.attachments[record.name] = len(record.data)
            elif isinstance(record, Footer):
                break
    except READ_ERRORS as error:
        found.damage = reason(error)
    return found


def _add_metadata(found: BagFile, record: Metadata) -> None:
    if record.name == RECORD:
        found.about = record.metadata
    elif record.name == END_RECORD:
        found.result = record.metadata


def _add_sizes(found: BagFile, compression: str, raw: int, packed: int) -> None:
    before = found.compressed.get(compression, (0, 0))
    found.compressed[compression] = (before[0] + raw, before[1] + packed)


def topic_of(channel: Channel, schema: Schema | None) -> BagTopic:
    """Returns the topic of a channel."""
    return BagTopic(
        channel.topic,
        "" if schema is None else schema.name,
        "" if schema is None else schema.data.decode(errors="replace"),
        channel.metadata.get("topic_type_hash", ""),
        qos_from(channel.metadata.get("offered_qos_profiles")),
    )


def merged(bag: Bag, topics: frozenset[str] | None = None) -> Iterator[BagMessage]:
    """Yields the messages of all files in the order of their log times.

    Raises:
        BagError: A file is damaged.
    """
    files = [file_messages(path, index, topics) for index, path in enumerate(bag.files)]
    return heapq.merge(*files, key=lambda message: message.log_time)


def _order(path: Path) -> tuple[int, str]:
    """Returns the key by which the files of a bag are sorted: by the number at the end of their name."""
    number = path.stem.rpartition("_")[2]
    return (int(number) if number.isascii() and number.isdecimal() else -1, path.name)


def reason(error: BaseException) -> str:
    """Returns in a few words why a file cannot be read."""
    text = str(error).strip()
    if isinstance(error, struct.error):
        return "it ends early"
    if type(error).__name__ == "EndOfFile" or isinstance(error, EOFError):
        return text or "it ends early"
    if type(error).__name__ in ("RecordLengthLimitExceeded", "InvalidMagic"):
        return "its end is missing"
    return text or type(error).__name__
