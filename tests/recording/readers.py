"""Bags as others read them: rosbags, and the readers of mcap."""

from dataclasses import dataclass

from mcap.reader import NonSeekingReader, make_reader
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore


@dataclass(frozen=True)
class Read:
    topic: str
    type: str
    log_time: int
    data: bytes


def by_rosbags(folder):
    """Every message of a bag, in the order of its times, after it has been decoded."""
    with Reader(folder) as reader:
        store = get_typestore(Stores.EMPTY)
        for connection in reader.connections:
            store.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
        found = []
        for connection, time, raw in reader.messages():
            store.deserialize_cdr(raw, connection.msgtype)
            found.append(Read(connection.topic, connection.msgtype, time, bytes(raw)))
        assert len(found) == reader.message_count
        assert sum(connection.msgcount for connection in reader.connections) == reader.message_count
        return found


def by_mcap(path):
    """Every message of a file by the index, and the same by reading it from the beginning."""
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        indexed = [
            Read(channel.topic, schema.name, message.log_time, message.data)
            for schema, channel, message, _ in reader.iter_decoded_messages(log_time_order=True)
        ]
        statistics = reader.get_summary().statistics
    assert statistics.message_count == len(indexed)
    with path.open("rb") as file:
        streamed = [
            (channel.topic, m.data) for _, channel, m in NonSeekingReader(file, validate_crcs=True).iter_messages()
        ]
    assert sorted(streamed) == sorted((read.topic, read.data) for read in indexed)
    with path.open("rb") as file:
        assert sum(1 for _ in StreamReader(file, validate_crcs=True).records) > 0
    return indexed


def metadata_of(path, name="mjplug"):
    with path.open("rb") as file:
        (record,) = (record.metadata for record in make_reader(file).iter_metadata() if record.name == name)
    return record
