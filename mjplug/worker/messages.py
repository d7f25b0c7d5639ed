"""What the server and a worker process say to each other: pickles, each with its length before it.

The server starts the process and holds the other ends of its pipes, so what is unpickled here cannot come from anybody
else. Nothing heavy is imported: the process reads the first message before it knows where to import from.
"""

import os
import pickle
import struct
from typing import Any, BinaryIO, NamedTuple

# Named tuples throughout: dataclasses that are frozen and have slots take ten times as long to pickle.

BEAT_INTERVAL = 1.0
"""How often a process says that it is alive [s]."""

_LENGTH = struct.Struct("<Q")


class ChildEnvironment(NamedTuple):
    """The first thing that a process hears. The compiled model and the pickled `ChildSetup` follow, each as its bytes.

    Attributes:
        name: The plugin instance's name.
        parent: The server's process id.
        sys_path: Where the server imports from.
        log_level: The lowest level that the server's log wants.
        states: Where the states are; see `mjplug.worker.states`.
        priority: How much processor time the process gets beside other programs: `idle`, `low` or `normal`.
    """

    name: str
    parent: int
    sys_path: tuple[str, ...]
    log_level: int
    states: int | str
    priority: str


class Beat(NamedTuple):
    """The process is alive. It is sent by a thread that does nothing else."""


class Ready(NamedTuple):
    """The work is open; `said` is what its `open` returned."""

    said: str


class Done(NamedTuple):
    """The job was performed; `report` is what `perform` returned."""

    report: Any


class Failed(NamedTuple):
    """The process ends.

    Attributes:
        reason: Why, in one sentence.
        permanent: Whether another process in the same environment would come no further.
    """

    reason: str
    permanent: bool = False


def write(fd: int, payload: bytes) -> None:
    """Writes one message.

    Raises:
        OSError: The other side is gone.
    """
    # One write for a short message: together with its length it wakes the reader once.
    parts = (_LENGTH.pack(len(payload)) + payload,) if len(payload) < 4096 else (_LENGTH.pack(len(payload)), payload)
    for part in parts:
        rest = memoryview(part)
        while rest:
            rest = rest[os.write(fd, rest) :]


def read(stream: BinaryIO) -> bytes | None:
    """Waits for one message; None when the other side is gone."""
    head = stream.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        return None
    (length,) = _LENGTH.unpack(head)
    payload = stream.read(length)
    return payload if len(payload) == length else None


def pack(message: Any) -> bytes:
    """Returns a message's bytes."""
    return pickle.dumps(message, pickle.HIGHEST_PROTOCOL)


def unpack(payload: bytes) -> Any:
    """Returns the message."""
    return pickle.loads(payload)
