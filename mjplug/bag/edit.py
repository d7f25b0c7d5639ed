"""Makes smaller bags from bags: a part of the time, some of the topics."""

import math
from collections import deque
from collections.abc import Callable
from pathlib import Path

from mjplug.bag.errors import BagError
from mjplug.bag.reader import Bag, BagMessage, file_messages
from mjplug.bag.topics import Compression
from mjplug.bag.writer import BagWriter, Limits, Record

_MAX_LATCHED = 256
"""Maximum number of latched messages from before the start. A bag does not say which publisher sent a message, so a
newer message may not replace those of other publishers.
"""


def copy(
    bag: Bag,
    folder: Path,
    chosen: Callable[[str], bool],
    start: float = 0.0,
    end: float = math.inf,
    compression: Compression = "auto",
) -> int:
    """Writes a new bag with a part of the messages of another one; their bytes and times do not change.

    Each file of the bag becomes one file. Messages of latched topics from before the start are at the start, because
    without them the rest cannot be understood.

    Args:
        bag: The bag.
        folder: The folder to create.
        chosen: Returns whether a topic is copied.
        start: First time to copy, from the beginning of the bag [s].
        end: Time up to which messages are copied, from the beginning of the bag [s].
        compression: How the messages are compressed.

    Returns:
        Number of messages that were copied.

    Raises:
        BagError: The bag is damaged, or the new one cannot be written.
    """
    summaries = bag.summaries()
    damaged = next((file for file in summaries if file.damage), None)
    if damaged is not None:
        raise BagError(f"{damaged.path} is damaged ({damaged.damage}); mjplug bag recover makes a bag of the rest")
    begin = min((file.start for file in summaries if file.messages), default=0)
    start_ns = begin + round(start * 1e9)
    end_ns = None if math.isinf(end) else begin + round(end * 1e9)
    writer = BagWriter(folder, compression, Limits(), bag.custom)
    copied = 0
    for index, file in enumerate(summaries):
        for topic in file.topics.values():
            if chosen(topic.name):
                writer.add_topic(topic)
        if index:
            writer.begin_part(file.about, forget=True)
            writer.end_previous()
        else:
            writer.describe(file.about)
        topics = frozenset(topic.name for topic in file.topics.values() if chosen(topic.name))
        before: deque[BagMessage] = deque(maxlen=_MAX_LATCHED)
        for message in file_messages(file.path, index, topics) if topics else ():
            if end_ns is not None and message.log_time > end_ns:
                break
            if message.log_time < start_ns:
                if message.topic.latched:
                    before.append(message)
                continue
            for kept in before:
                writer.write(_record(kept, start_ns))
                copied += 1
            before.clear()
            writer.write(_record(message, message.log_time))
            copied += 1
    writer.finish()
    return copied


def _record(message: BagMessage, log_time: int) -> Record:
    return Record(message.topic.name, log_time, message.publish_time, message.sequence, message.data)
