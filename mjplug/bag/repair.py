"""Checks bags, and recovers those whose recorder was killed or whose files are damaged."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from mcap.records import Attachment, Channel, Chunk, DataEnd, Message, Metadata, Schema

from mjplug.bag.errors import BagError
from mjplug.bag.metadata import NAME
from mjplug.bag.reader import READ_ERRORS, Bag, BagFile, reason, records, summary, topic_of
from mjplug.bag.topics import BagTopic, Compression
from mjplug.bag.writer import RECORD, BagWriter, Limits, Record


def check(bag: Bag) -> Iterator[str]:
    """Yields what is wrong with a bag, one sentence each: reads every record and compares index and checksums."""
    if bag.path.is_dir() and not bag.has_metadata:
        yield f"{bag.path}/{NAME} is missing or cannot be read"
    if bag.open:
        yield f"{bag.path}: the recording was not completed, or it is still running"
    for path in bag.files:
        yield from _check_file(path, summary(path))


def _check_file(path: Path, found: BagFile) -> Iterator[str]:
    if found.damage:
        yield f"{path}: {found.damage}; {found.messages} messages can be read"
        return
    counts: dict[int, int] = {}
    channels: dict[int, Channel] = {}
    schemas: dict[int, Schema] = {}
    ended = False
    try:
        for record in records(path):
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Message):
                if record.channel_id not in channels:
                    yield f"{path}: a message refers to channel {record.channel_id}, which does not exist"
                    return
                counts[record.channel_id] = counts.get(record.channel_id, 0) + 1
            elif isinstance(record, DataEnd):
                ended = True
                break
    except READ_ERRORS as error:
        yield f"{path}: after {sum(counts.values())} of {found.messages} messages: {reason(error)}"
        return
    if not ended:
        yield f"{path}: its end is missing"
    if counts != {channel: count for channel, count in found.counts.items() if count}:
        yield f"{path}: its index says {found.messages} messages, but it contains {sum(counts.values())}"
    for channel in channels.values():
        if channel.message_encoding != "cdr" or getattr(schemas.get(channel.schema_id), "encoding", "") != "ros2msg":
            yield f"{path}: topic {channel.topic} is not encoded as ros2msg and cdr, so ROS 2 cannot read it"


@dataclass(slots=True)
class Recovered:
    """The result of a recovery.

    Attributes:
        messages: Number of messages in the new bag.
        damage: What could not be read, by file.
    """

    messages: int = 0
    damage: dict[str, str] = field(default_factory=dict)


def recover(bag: Bag, folder: Path, compression: Compression = "auto") -> Recovered:
    """Writes a new bag with all messages of another one that can be read.

    Each file of the bag becomes one file, so that the lives of the server stay apart.

    Args:
        bag: The bag.
        folder: The folder to create.
        compression: How the messages are compressed.

    Raises:
        BagError: Nothing can be read, or the new bag cannot be written.
    """
    result = Recovered()
    custom = {name: value for name, value in bag.custom.items() if name != "mjplug_open"}
    writer = BagWriter(folder, compression, Limits(), custom)
    for number, path in enumerate(bag.files):
        if number:
            writer.begin_part({}, forget=True)
            writer.end_previous()
        _recover_file(path, writer, result)
    writer.finish()
    if not result.messages and result.damage:
        raise BagError(f"no message of {bag.path} can be read: {next(iter(result.damage.values()))}")
    return result


def _recover_file(path: Path, writer: BagWriter, result: Recovered) -> None:
    schemas: dict[int, Schema] = {}
    topics: dict[int, BagTopic] = {}
    try:
        for record in records(path):
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                topics[record.id] = topic_of(record, schemas.get(record.schema_id))
                writer.add_topic(topics[record.id])
            elif isinstance(record, Message):
                topic = topics[record.channel_id]
                writer.write(
                    Record(topic.name, record.log_time, record.publish_time, record.sequence, bytes(record.data))
                )
                result.messages += 1
            elif isinstance(record, Metadata) and record.name == RECORD:
                writer.describe(record.metadata)
            elif isinstance(record, Attachment):
                writer.attach(record.name, record.media_type, record.data)
            elif isinstance(record, Chunk):
                continue
            elif isinstance(record, DataEnd):
                return
        result.damage[path.name] = "its end is missing"
    except READ_ERRORS as error:
        result.damage[path.name] = reason(error)
