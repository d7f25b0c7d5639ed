"""The messages between the server and a worker process: pickles, each with its length before it.

The server starts the process and holds the other ends of its pipes, so no other program can send pickles. This module
imports only the standard library, because the process reads the first message before it knows the server's `sys.path`.
"""

import os
import pickle
import struct
from typing import Any, BinaryIO, NamedTuple

# Named tuples, because frozen dataclasses with slots take ten times as long to pickle.

HEARTBEAT_INTERVAL = 1.0
"""Interval between two heartbeats of a process [s]."""

_LENGTH = struct.Struct("<Q")


class ChildEnvironment(NamedTuple):
    """The first message to a process. The compiled model and the pickled `ChildSetup` follow as bytes.

    Attributes:
        name: The plugin instance's name.
        parent: The server's process id.
        sys_path: The server's `sys.path`.
        log_level: The lowest level that the server logs.
        states: Handle of the shared states; see `mjplug.worker.states`.
        priority: CPU priority of the process: `idle`, `low` or `normal`.
        plugin_libraries: Libraries with plugins of the MuJoCo engine that the model needs.
    """

    name: str
    parent: int
    sys_path: tuple[str, ...]
    log_level: int
    states: int | str
    priority: str
    plugin_libraries: tuple[str, ...] = ()


class Heartbeat(NamedTuple):
    """The process is alive. A thread of its own sends it."""


class Ready(NamedTuple):
    """The work is open; `text` is the result of `Work.open`."""

    text: str


class Done(NamedTuple):
    """The job was performed; `report` is the result of `Work.perform`."""

    report: Any


class Failed(NamedTuple):
    """The process ends because of a failure.

    Attributes:
        reason: The reason, in one sentence.
        permanent: Whether another process in the same environment would fail too.
    """

    reason: str
    permanent: bool = False


def write(fd: int, payload: bytes | memoryview) -> None:
    """Writes one message.

    Raises:
        OSError: The other process has ended.
    """
    # A short message is written together with its length, so that the reader wakes up only once.
    parts = (_LENGTH.pack(len(payload)) + payload,) if len(payload) < 4096 else (_LENGTH.pack(len(payload)), payload)
    for part in parts:
        rest = memoryview(part)
        while rest:
            rest = rest[os.write(fd, rest) :]


def read(stream: BinaryIO) -> bytes | None:
    """Waits for one message and returns it; None if the other process has ended."""
    head = stream.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        return None
    (length,) = _LENGTH.unpack(head)
    payload = stream.read(length)
    return payload if len(payload) == length else None


def pack(message: Any) -> bytes:
    """Encodes a message."""
    return pickle.dumps(message, pickle.HIGHEST_PROTOCOL)


def unpack(payload: bytes) -> Any:
    """Decodes a message."""
    return pickle.loads(payload)
