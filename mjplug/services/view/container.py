"""The file format of the drawing pack: a JSON header and the binary buffers that it refers to."""

import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

MAGIC = b"MJV1"
_ALIGNMENT = 8


class Buffers:
    """Collects the binary buffers of a pack; each starts at a multiple of 8 bytes."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0

    def array(self, values: NDArray[Any]) -> dict[str, Any]:
        """Adds an array; returns its entry for the header: `offset` [bytes], `type` such as `f4`, and `shape`."""
        little = np.ascontiguousarray(values).astype(values.dtype.newbyteorder("<"), copy=False)
        return {"offset": self._add(little.tobytes()), "type": values.dtype.str[1:], "shape": [*values.shape]}

    def file(self, content: bytes) -> dict[str, Any]:
        """Adds a file such as an image; returns its entry for the header: `offset` and `size` [bytes]."""
        return {"offset": self._add(content), "size": len(content)}

    def pack(self, header: Mapping[str, Any]) -> bytes:
        """Returns the whole pack.

        It is `MJV1`, the length of the header (uint32, little-endian), the header in JSON, padding to a multiple of 8
        bytes, and the buffers. Offsets count from the first buffer.
        """
        text = json.dumps(header, separators=(",", ":"), allow_nan=False).encode()
        start = struct.pack("<4sI", MAGIC, len(text)) + text
        return b"".join((start, _padding(len(start)), *self._parts))

    def _add(self, content: bytes) -> int:
        offset = self._size
        self._parts += (content, padding := _padding(len(content)))
        self._size += len(content) + len(padding)
        return offset


def _padding(size: int) -> bytes:
    return bytes(-size % _ALIGNMENT)
