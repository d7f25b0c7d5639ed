"""The file `metadata.yaml` of a bag, in version 8 of rosbag2, which Humble and later can read."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from mjplug.bag.topics import BagTopic, qos_text

NAME = "metadata.yaml"
OPEN = "mjplug_open"
"""Key in the custom data of a bag that is being recorded, or whose recorder was killed."""

_VERSION = 8


@dataclass(frozen=True, slots=True)
class FileInfo:
    """One file of a bag.

    Attributes:
        name: Its name.
        start: First log time [ns]; 0 without messages.
        end: Last log time [ns].
        counts: Number of messages by topic.
    """

    name: str
    start: int = 0
    end: int = 0
    counts: dict[str, int] = field(default_factory=dict)

    @property
    def messages(self) -> int:
        """Number of messages."""
        return sum(self.counts.values())


def metadata_text(topics: Sequence[BagTopic], files: Sequence[FileInfo], custom: dict[str, str]) -> str:
    """Returns the text of `metadata.yaml`.

    Args:
        topics: The topics.
        files: The files, in the order of recording.
        custom: Further data.
    """
    filled = [file for file in files if file.messages]
    start = min((file.start for file in filled), default=0)
    end = max((file.end for file in filled), default=0)
    content: dict[str, Any] = {
        "version": _VERSION,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": end - start},
        "starting_time": {"nanoseconds_since_epoch": start},
        "message_count": sum(file.messages for file in files),
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": qos_text(topic.qos),
                    "type_description_hash": topic.hash,
                },
                "message_count": sum(file.counts.get(topic.name, 0) for file in files),
            }
            for topic in topics
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.name for file in files],
        "files": [
            {
                "path": file.name,
                "starting_time": {"nanoseconds_since_epoch": file.start},
                "duration": {"nanoseconds": file.end - file.start},
                "message_count": file.messages,
            }
            for file in files
        ],
        "custom_data": custom,
        "ros_distro": "mjplug",
    }
    text: str = yaml.safe_dump({"rosbag2_bagfile_information": content}, sort_keys=False)
    return text


def write_metadata(folder: Path, text: str) -> None:
    """Replaces `metadata.yaml`, completely or not at all.

    Raises:
        OSError: It cannot be written.
    """
    part = folder / f".{NAME}.part"
    try:
        part.write_text(text, encoding="utf-8")
        os.replace(part, folder / NAME)
    except OSError:
        part.unlink(missing_ok=True)
        raise
