"""Memory for two states that the server and one worker process share.

The memory is anonymous, so nothing remains if a process crashes: it is freed when the last process unmaps it.
"""

import contextlib
import mmap
import os
import sys
import tempfile
import uuid

import numpy as np

_BYTES = 8
"""Size of a float64."""


class SharedStates:
    """Two states in shared memory. The messages between the processes decide which process uses which state.

    Attributes:
        slots: The states, shape (2, size); see `mjplug.physics.snapshot`.
        handle: The argument of `attach` in the other process: an inherited file descriptor, or a name on Windows.

    Args:
        memory: The shared memory.
        size: Number of float64 values in a state.
        handle: See the attribute.
    """

    def __init__(self, memory: mmap.mmap, size: int, handle: int | str) -> None:
        self.slots = np.frombuffer(memory, np.float64, 2 * size).reshape(2, size)
        self.handle = handle

    @classmethod
    def create(cls, size: int) -> "SharedStates":
        """Creates the memory.

        Args:
            size: Number of float64 values in a state.
        """
        length = max(2 * size * _BYTES, _BYTES)
        if sys.platform == "win32":
            name = f"mjplug-{uuid.uuid4()}"
            return cls(mmap.mmap(-1, length, tagname=name), size, name)
        fd = _anonymous_file()
        os.ftruncate(fd, length)
        return cls(mmap.mmap(fd, length), size, fd)

    @classmethod
    def attach(cls, handle: int | str, size: int) -> "SharedStates":
        """Maps, in the worker process, the memory that the server has created."""
        length = max(2 * size * _BYTES, _BYTES)
        if sys.platform == "win32":
            return cls(mmap.mmap(-1, length, tagname=str(handle)), size, handle)
        return cls(mmap.mmap(int(handle), length), size, handle)

    @property
    def inherited(self) -> tuple[int, ...]:
        """The file descriptors that the worker process must inherit."""
        return (self.handle,) if isinstance(self.handle, int) else ()

    def close(self) -> None:
        """Closes the file; the memory itself exists as long as `slots`. A second call does nothing."""
        if isinstance(self.handle, int):
            with contextlib.suppress(OSError):
                os.close(self.handle)
            self.handle = ""


def _anonymous_file() -> int:
    if hasattr(os, "memfd_create"):
        # Not backed by a disk, because writing to one could delay a physics step.
        return os.memfd_create("mjplug-states")
    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())
