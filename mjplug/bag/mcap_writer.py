"""Writes one MCAP file: messages in compressed chunks, each written as a whole or not at all.

The writer of the package `mcap` has one compression for the file and a fixed level, and cannot continue after a full
disk. This one keeps a chunk for each compression, and can give up its last chunks so that the end of the file fits.
"""

import os
import zlib
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from struct import Struct
from typing import Any, Final

import lz4.frame
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

MAGIC: Final = b"\x89MCAP0\r\n"
CHUNK_SIZE: Final = 1 << 20
"""Size of uncompressed messages at which a chunk is written [bytes]."""

_MESSAGE = Struct("<BQHIQQ")
_MESSAGE_HEAD = _MESSAGE.size - 9
_CHUNK = Struct("<QQQI")
_INDEX = Struct("<BQHI")
_ENTRY = Struct("<QQ")
_LENGTH = Struct("<BQ")
_ZSTD_LEVEL = 1

Compress = Callable[[bytes], bytes]


def _codecs() -> dict[str, Compress]:
    compressor = zstandard.ZstdCompressor(level=_ZSTD_LEVEL)
    return {"zstd": compressor.compress, "lz4": lz4.frame.compress, "": lambda data: data}


@dataclass(slots=True)
class _OpenChunk:
    """Messages that are not in the file yet."""

    parts: list[bytes] = field(default_factory=list)
    size: int = 0
    start: int = 0
    end: int = 0
    entries: dict[int, list[tuple[int, int]]] = field(default_factory=lambda: defaultdict(list))

    def add(self, channel: int, log_time: int, publish_time: int, sequence: int, data: bytes) -> None:
        head = _MESSAGE.pack(Opcode.MESSAGE, _MESSAGE_HEAD + len(data), channel, sequence, log_time, publish_time)
        self.start = min(self.start, log_time) if self.parts else log_time
        self.end = max(self.end, log_time) if self.parts else log_time
        self.entries[channel].append((log_time, self.size))
        self.parts += (head, data)
        self.size += len(head) + len(data)


@dataclass(frozen=True, slots=True)
class _Written:
    """A chunk in the file, and its number of messages by channel."""

    index: ChunkIndex
    counts: Mapping[int, int]


class McapWriter:
    """Writes a new MCAP file with the profile of ROS 2.

    Attributes:
        path: The file.
        size: Number of bytes in the file.

    Args:
        path: A file that does not exist.
        library: Name of the program, for the header.

    Raises:
        OSError: The file cannot be created or written.
    """

    def __init__(self, path: Path, library: str) -> None:
        self.path = path
        self.size = 0
        self._file = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY | getattr(os, "O_CLOEXEC", 0), 0o666)
        self._codecs = _codecs()
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._groups: dict[int, str] = {}
        self._open: dict[str, _OpenChunk] = defaultdict(_OpenChunk)
        self._chunks: list[_Written] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        try:
            self._append(MAGIC, _record(Header("ros2", library)))
        except OSError:
            os.close(self._file)
            raise

    @property
    def pending(self) -> int:
        """Number of bytes of messages that are not in the file yet."""
        return sum(chunk.size for chunk in self._open.values())

    @property
    def counts(self) -> dict[int, int]:
        """Number of messages in the file, by channel."""
        counts = dict.fromkeys(self._channels, 0)
        for chunk in self._chunks:
            for channel, count in chunk.counts.items():
                counts[channel] = counts.get(channel, 0) + count
        return counts

    @property
    def span(self) -> tuple[int, int] | None:
        """The first and the last log time in the file [ns]; None if it contains no message."""
        if not self._chunks:
            return None
        indices = [chunk.index for chunk in self._chunks]
        return min(index.message_start_time for index in indices), max(index.message_end_time for index in indices)

    def add_channel(
        self, topic: str, type: str, definition: str, metadata: Mapping[str, str], group: str = "zstd"
    ) -> int:
        """Adds a topic.

        Args:
            topic: Full name of the topic.
            type: Name of its type.
            definition: Text of the type and of the types of its fields, in the format `ros2msg`.
            metadata: Metadata of the channel.
            group: Compression of its messages, `zstd`, `lz4` or empty, and after a colon the name of the chunk that
                contains them; topics with large messages are read faster if those with small ones are elsewhere.

        Returns:
            The id of the channel.

        Raises:
            OSError: The file cannot be written.
        """
        known = next((s.id for s in self._schemas.values() if s.name == type and s.data == definition.encode()), None)
        records = []
        schema = Schema(known or len(self._schemas) + 1, definition.encode(), "ros2msg", type)
        if known is None:
            records.append(_record(schema))
        channel = Channel(len(self._channels) + 1, topic, "cdr", dict(metadata), schema.id)
        self._append(*records, _record(channel))
        self._schemas[schema.id] = schema
        self._channels[channel.id] = channel
        self._groups[channel.id] = group
        return channel.id

    def write(self, channel: int, log_time: int, publish_time: int, sequence: int, data: bytes) -> None:
        """Adds a message. It is in the file when its chunk is full, or after `flush`.

        Raises:
            OSError: The file cannot be written. The messages of the chunk are lost; those before are in the file.
        """
        group = self._groups[channel]
        chunk = self._open[group]
        chunk.add(channel, log_time, publish_time, sequence & 0xFFFFFFFF, data)
        if chunk.size >= CHUNK_SIZE:
            self._write_chunk(group)

    def flush(self, sync: bool = False) -> None:
        """Writes all messages into the file.

        Args:
            sync: Whether to wait until the disk has stored them.

        Raises:
            OSError: As for `write`.
        """
        for group in tuple(self._open):
            self._write_chunk(group)
        if sync:
            os.fsync(self._file)

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Adds a metadata record.

        Raises:
            OSError: The file cannot be written.
        """
        record = _record(Metadata(name=name, metadata=dict(values)))
        self._metadata.append(MetadataIndex(offset=self.size, length=len(record), name=name))
        try:
            self._append(record)
        except OSError:
            self._metadata.pop()
            raise

    def add_attachment(self, name: str, media_type: str, data: bytes, log_time: int = 0, create_time: int = 0) -> None:
        """Adds an attachment.

        Raises:
            OSError: The file cannot be written.
        """
        record = _record(Attachment(create_time, log_time, name, media_type, data))
        offset = self.size
        self._append(record)
        self._attachments.append(
            AttachmentIndex(offset, len(record), log_time, create_time, len(data), name, media_type)
        )

    def drop_last_chunk(self) -> bool:
        """Removes the last chunk and everything after it from the file; returns whether there was one."""
        if not self._chunks:
            return False
        at = self._chunks.pop().index.chunk_start_offset
        self._metadata = [index for index in self._metadata if index.offset < at]
        self._attachments = [index for index in self._attachments if index.offset < at]
        self._truncate(at)
        return True

    def finish(self) -> None:
        """Writes the index at the end of the file. A failed call may be repeated.

        Raises:
            OSError: The file cannot be written.
        """
        self.flush()
        end = _record(DataEnd(0))
        summary, offsets = RecordBuilder(), []
        begin = self.size + len(end)
        span = self.span or (0, 0)
        counts = {channel: count for channel, count in self.counts.items() if count}
        statistics = Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=counts,
            chunk_count=len(self._chunks),
            message_count=sum(counts.values()),
            message_end_time=span[1],
            message_start_time=span[0],
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )
        groups: list[tuple[Opcode, list[Any]]] = [
            (Opcode.SCHEMA, [*self._schemas.values()]),
            (Opcode.CHANNEL, [*self._channels.values()]),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, [chunk.index for chunk in self._chunks]),
            (Opcode.ATTACHMENT_INDEX, self._attachments),
            (Opcode.METADATA_INDEX, self._metadata),
        ]
        for opcode, records in groups:
            start = summary.count
            for record in records:
                record.write(summary)
            if records:
                offsets.append(SummaryOffset(opcode, begin + start, summary.count - start))
        offset_start = begin + summary.count
        for offset in offsets:
            offset.write(summary)
        text: bytes = summary.end()  # type: ignore[no-untyped-call]
        footer = _record(Footer(begin, offset_start, 0))[:-4]
        checked = zlib.crc32(footer, zlib.crc32(text))
        self._append(end, text, footer, checked.to_bytes(4, "little"), MAGIC)

    def close(self) -> None:
        """Closes the file; a second call does nothing."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def sync(self) -> None:
        """Waits until the disk has stored the file.

        Raises:
            OSError: The disk failed.
        """
        os.fsync(self._file)

    def _write_chunk(self, group: str) -> None:
        chunk = self._open.pop(group, None)
        if chunk is None or not chunk.parts:
            return
        compression = group.partition(":")[0]
        raw = b"".join(chunk.parts)
        data = self._codecs[compression](raw)
        name = compression.encode()
        content = _CHUNK.pack(chunk.start, chunk.end, len(raw), zlib.crc32(raw))
        head = content + len(name).to_bytes(4, "little") + name + len(data).to_bytes(8, "little")
        begin = self.size
        chunk_length = _LENGTH.size + len(head) + len(data)
        parts = [_LENGTH.pack(Opcode.CHUNK, len(head) + len(data)), head, data]
        offsets, at = {}, begin + chunk_length
        for channel, entries in chunk.entries.items():
            packed = b"".join(_ENTRY.pack(*entry) for entry in entries)
            index = _INDEX.pack(Opcode.MESSAGE_INDEX, 6 + len(packed), channel, len(packed)) + packed
            parts.append(index)
            offsets[channel] = at
            at += len(index)
        self._append(*parts)
        index_record = ChunkIndex(
            chunk_length=chunk_length,
            chunk_start_offset=begin,
            compression=compression,
            compressed_size=len(data),
            message_end_time=chunk.end,
            message_index_length=at - begin - chunk_length,
            message_index_offsets=offsets,
            message_start_time=chunk.start,
            uncompressed_size=len(raw),
        )
        counts = {channel: len(entries) for channel, entries in chunk.entries.items()}
        self._chunks.append(_Written(index_record, counts))

    def _append(self, *parts: bytes) -> None:
        """Writes all parts, or nothing."""
        begin = self.size
        try:
            for part in parts:
                rest = memoryview(part)
                while rest:
                    rest = rest[os.write(self._file, rest) :]
                self.size += len(part)
        except OSError:
            self._truncate(begin)
            raise

    def _truncate(self, size: int) -> None:
        os.ftruncate(self._file, size)
        os.lseek(self._file, size, os.SEEK_SET)
        self.size = size


def _record(record: Any) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    # mcap's stubs leave the return type open.
    encoded: bytes = builder.end()  # type: ignore[no-untyped-call]
    return encoded
