"""Memory for two states that the server and one process share.

It has no name that could be left behind: whoever still maps it keeps it alive, and with the last one it is gone.
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
    """Two states, as rows of `slots`, of shape (2, size). Who may write to a row is agreed by message, not here.

    Attributes:
        slots: The states.
        handle: What the other process needs to `attach`: an inherited file descriptor, or a name on Windows.
    """

    def __init__(self, memory: mmap.mmap, size: int, handle: int | str) -> None:
        self.slots = np.frombuffer(memory, np.float64, 2 * size).reshape(2, size)
        self.handle = handle

    @classmethod
    def create(cls, size: int) -> "SharedStates":
        """Makes the memory.

        Args:
            size: How many numbers a state has.
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
        """Maps, in the process, what the server has made."""
        length = max(2 * size * _BYTES, _BYTES)
        if sys.platform == "win32":
            return cls(mmap.mmap(-1, length, tagname=str(handle)), size, handle)
        return cls(mmap.mmap(int(handle), length), size, handle)

    @property
    def inherited(self) -> tuple[int, ...]:
        """The file descriptors that the other process must get."""
        return (self.handle,) if isinstance(self.handle, int) else ()

    def close(self) -> None:
        """Closes the file; the memory itself lives as long as `slots`. A second call does nothing."""
        if isinstance(self.handle, int):
            with contextlib.suppress(OSError):
                os.close(self.handle)
            self.handle = ""


def _anonymous_file() -> int:
    if hasattr(os, "memfd_create"):
        # Never written to a disk: waiting for that could stop a physics step.
        return os.memfd_create("mjplug-states")
    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())
