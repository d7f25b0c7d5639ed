"""A message that is encoded as CDR once; its numbers are then written in place, at little cost per message."""

import struct
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mjplug.errors import UnknownName
from mjplug_schemas.cdr import Span, encode_with_layout
from mjplug_schemas.message import Message

_HEADER = 4
"""Size of the CDR encapsulation header [bytes]; alignment counts from its end."""

_PADDING = 4
"""Number of bytes that are put before the payload and then removed [bytes]. CPython leaves the rest in place, so the
body starts at a multiple of 8 and numpy's views are aligned. Other interpreters may copy; views are then slower."""

_WIDEST = 8
"""Size of the widest number, to which it is aligned [bytes]."""

_STAMP = struct.Struct("<iI")
_NANOSECONDS = 1_000_000_000

_CODES = {
    "bool": "?",
    "byte": "B",
    "char": "B",
    "int8": "b",
    "uint8": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
}
"""Codes of numbers for `struct` and numpy."""


class CdrFrame:
    """The CDR bytes of one message, with writable numpy views of its numbers.

    Strings and the length of every sequence cannot change; build a new frame to change them. Not thread-safe.

    Attributes:
        type: The message's class.
        buffer: The CDR bytes; every write changes them.

    Args:
        message: The message with the strings, the lengths and the first values.
    """

    def __init__(self, message: Message) -> None:
        encoded, self._layout = encode_with_layout(message)
        self.type = type(message)
        self.buffer = bytearray(_PADDING) + encoded
        del self.buffer[:_PADDING]
        self._stamps: dict[str, int] = {}

    def view(self, path: str) -> NDArray[Any]:
        """Returns a writable view, shape (n,), of a number, an array of numbers, or a struct of numbers of one type.

        Args:
            path: A field such as `position`, `header.stamp.sec` or `free_joints[3].pose.pose.position`.
                The last one is a point: its three numbers are contiguous, so the view has shape (3,).

        Raises:
            UnknownName: The message has no such field.
            TypeError: The field contains text, or its numbers have different types or are not contiguous.
        """
        spans = self._spans(path)
        dtype = self._dtype(path, spans)
        end = spans[0].offset
        for span in spans:
            if span.offset != end:
                raise TypeError(f"the numbers of {path!r} are not contiguous; use views of its fields")
            end += span.count * dtype.itemsize
        return np.frombuffer(self.buffer, dtype, sum(span.count for span in spans), spans[0].offset)

    def slots(self, paths: Iterable[str]) -> "Slots":
        """Returns the numbers of several fields, which need not be contiguous, as one flat sequence to write.

        Args:
            paths: Fields as for `view`, all of one numeric type.

        Raises:
            UnknownName: The message has no such field.
            TypeError: The fields contain text, or numbers of different types.
        """
        paths = list(paths)
        spans = [span for path in paths for span in self._spans(path)]
        if not spans:
            return Slots(np.empty(0), np.empty(0, np.intp))
        dtype = self._dtype(", ".join(paths[:3]), spans)
        # The body is aligned, so every number of this type is an element of a view of the whole body.
        words = np.frombuffer(self.buffer, dtype, (len(self.buffer) - _HEADER) // dtype.itemsize, _HEADER)
        first = [(span.offset - _HEADER) // dtype.itemsize for span in spans]
        index = np.concatenate([np.arange(at, at + span.count) for at, span in zip(first, spans, strict=True)])
        return Slots(words, index.astype(np.intp))

    def writer(self, paths: Sequence[str]) -> Callable[..., None]:
        """Returns a function that writes the numbers of several fields at once; its arguments are the numbers.

        This is the fastest way to write a few numbers.

        Args:
            paths: Fields as for `view`, of any numeric types, in the order of the message. Only padding may lie between
                them.

        Raises:
            UnknownName: The message has no such field.
            TypeError: The fields contain text, or other values lie between them.
        """
        spans = [span for path in paths for span in self._spans(path)]
        layout, end = "<", spans[0].offset
        for span in spans:
            code, gap = _CODES.get(span.primitive), span.offset - end
            if code is None or not 0 <= gap < _WIDEST:
                raise TypeError(f"{', '.join(paths)} are not adjacent numbers")
            layout += f"{gap}x{span.count}{code}"
            end = span.offset + span.count * struct.calcsize(f"<{code}")
        return partial(struct.Struct(layout).pack_into, self.buffer, spans[0].offset)

    def set_stamp(self, path: str, time_ns: int) -> None:
        """Writes a builtin_interfaces/Time.

        Args:
            path: The field, such as `header.stamp`.
            time_ns: The time [ns].

        Raises:
            UnknownName: The message has no such time stamp.
            struct.error: The seconds do not fit into an int32.
        """
        offset = self._stamps.get(path)
        if offset is None:
            offset = self._stamps[path] = self._stamp_offset(path)
        _STAMP.pack_into(self.buffer, offset, *divmod(time_ns, _NANOSECONDS))

    def payload(self) -> bytes:
        """Returns a copy of `buffer`, which can be sent while the next values are written."""
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
        if len(kinds) != 1 or not kinds <= _CODES.keys():
            raise TypeError(f"{path!r} contains {' and '.join(sorted(kinds))}; a view needs numbers of one type")
        return np.dtype("<" + _CODES[kinds.pop()])


class Slots:
    """Numbers of a frame that need not be contiguous, in the order in which they were requested.

    Args:
        words: The frame's body as an array, shape (m,).
        index: Indices in `words` of the numbers, shape (n,).
    """

    def __init__(self, words: NDArray[Any], index: NDArray[np.intp]) -> None:
        self._words = words
        self._index = index

    def __len__(self) -> int:
        return len(self._index)

    def write(self, values: ArrayLike) -> None:
        """Writes all numbers; `values` has shape (n,)."""
        self._words[self._index] = values
