"""A message kept ready as CDR bytes, whose numbers are written in place: what a publisher needs at every step."""

import struct
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mjplug.errors import UnknownName
from mjplug_schemas.cdr import Span, encode_with_layout
from mjplug_schemas.message import Message

_HEADER = 4
"""The CDR encapsulation header [bytes]; alignment counts from its end."""

_PADDING = 4
"""Bytes put before the payload and cut off again: CPython then leaves the rest where it is, so that the body starts at
a multiple of 8 and numpy sees aligned numbers. Elsewhere they would only be slower."""

_STAMP = struct.Struct("<iI")
_NANOSECONDS = 1_000_000_000

_DTYPES = {
    "bool": "?",
    "byte": "u1",
    "char": "u1",
    "int8": "i1",
    "uint8": "u1",
    "int16": "<i2",
    "uint16": "<u2",
    "int32": "<i4",
    "uint32": "<u4",
    "int64": "<i8",
    "uint64": "<u8",
    "float32": "<f4",
    "float64": "<f8",
}


class CdrFrame:
    """The CDR bytes of one message, with writable numpy views on its numbers.

    What the message fixes stays fixed: strings, and the length of every sequence. When those change, build a new frame.
    Not thread-safe.

    Attributes:
        type: The message's class.
        buffer: The message's CDR bytes themselves; they change with the next write.

    Args:
        message: Gives the strings, the lengths and the first values.
    """

    def __init__(self, message: Message) -> None:
        encoded, self._layout = encode_with_layout(message)
        self.type = type(message)
        self.buffer = bytearray(_PADDING) + encoded
        del self.buffer[:_PADDING]
        self._stamps: dict[str, int] = {}

    def view(self, path: str) -> NDArray[Any]:
        """Returns a writable view, of shape (n,), on a number, an array of numbers, or a struct of one kind of number.

        Args:
            path: A field such as `position`, `header.stamp.sec` or `free_joints[3].pose.pose.position`.
                The last is a point: its three numbers follow each other, so the view has shape (3,).

        Raises:
            UnknownName: The message has no such field.
            TypeError: The field holds text, or numbers that are not of one type or not next to each other.
        """
        spans = self._spans(path)
        dtype = self._dtype(path, spans)
        end = spans[0].offset
        for span in spans:
            if span.offset != end:
                raise TypeError(f"the numbers of {path!r} are not next to each other; take views of its fields")
            end += span.count * dtype.itemsize
        return np.frombuffer(self.buffer, dtype, sum(span.count for span in spans), spans[0].offset)

    def slots(self, paths: Iterable[str]) -> "Slots":
        """Returns the numbers of many fields, wherever they lie, as one flat array to assign.

        Args:
            paths: Fields as for `view`, all of one numeric type.

        Raises:
            UnknownName: The message has no such field.
            TypeError: The fields hold text, or numbers of different types.
        """
        paths = list(paths)
        spans = [span for path in paths for span in self._spans(path)]
        if not spans:
            return Slots(np.empty(0), np.empty(0, np.intp))
        dtype = self._dtype(", ".join(paths[:3]), spans)
        # A view of the whole body as this type: the body is aligned, so every such number is one of its elements.
        words = np.frombuffer(self.buffer, dtype, (len(self.buffer) - _HEADER) // dtype.itemsize, _HEADER)
        first = [(span.offset - _HEADER) // dtype.itemsize for span in spans]
        index = np.concatenate([np.arange(at, at + span.count) for at, span in zip(first, spans, strict=True)])
        return Slots(words, index.astype(np.intp))

    def set_stamp(self, path: str, time_ns: int) -> None:
        """Writes a builtin_interfaces/Time.

        Args:
            path: The field, such as `header.stamp`.
            time_ns: The time [ns].

        Raises:
            UnknownName: The message has no such stamp.
            struct.error: The seconds do not fit an int32.
        """
        offset = self._stamps.get(path)
        if offset is None:
            offset = self._stamps[path] = self._stamp_offset(path)
        _STAMP.pack_into(self.buffer, offset, *divmod(time_ns, _NANOSECONDS))

    def payload(self) -> bytes:
        """Returns a copy of `buffer`, which may be sent while the next values are written."""
        return bytes(self.buffer)

    def _stamp_offset(self, path: str) -> int:
        stamps = [name.removesuffix(".sec") for name in self._layout if name.endswith(".sec")]
        if path not in stamps:
            raise UnknownName("stamp", path, stamps)
        return self._layout[f"{path}.sec"].offset

    def _spans(self, path: str) -> list[Span]:
        if span := self._layout.get(path):
            return [span]
        inside = [span for name, span in self._layout.items() if name.startswith((f"{path}.", f"{path}["))]
        if not inside:
            raise UnknownName("field", path, self._layout)
        return inside

    @staticmethod
    def _dtype(path: str, spans: list[Span]) -> "np.dtype[Any]":
        kinds = {span.primitive for span in spans}
        if len(kinds) != 1 or not kinds <= _DTYPES.keys():
            raise TypeError(f"{path!r} holds {' and '.join(sorted(kinds))}; a view needs numbers of one type")
        return np.dtype(_DTYPES[kinds.pop()])


class Slots:
    """Numbers at scattered places of a frame, in the order they were asked for.

    Args:
        words: The frame's body as an array.
        index: The elements of it that belong to the slots.
    """

    def __init__(self, words: NDArray[Any], index: NDArray[np.intp]) -> None:
        self._words = words
        self._index = index

    def __len__(self) -> int:
        return len(self._index)

    def write(self, values: ArrayLike) -> None:
        """Writes all slots; `values` has shape (len(self),)."""
        self._words[self._index] = values
