"""Finds the position of each value in an encoded message, so that new values can be written into the buffer."""

import struct
from dataclasses import dataclass

from pydantic import BaseModel

from mjplug_schemas.idl import Primitive
from mjplug_schemas.shape import Field, fields


@dataclass(frozen=True, slots=True)
class Span:
    """The position of one value, or of all elements of a sequence or array of numbers.

    Attributes:
        offset: Offset from the start of the buffer, including the 4-byte header [bytes].
        count: Number of elements; for strings, number of bytes without the terminating NUL.
        primitive: Name of the element type, such as `float64`.
    """

    offset: int
    count: int
    primitive: str


def spans(message: type[BaseModel], buffer: bytearray) -> dict[str, Span]:
    """Returns the position of each value, by path, in a buffer with a little-endian message of this type."""
    walk = _Walk(buffer)
    walk.message(message, "")
    return walk.spans


class _Walk:
    def __init__(self, buffer: bytearray) -> None:
        self.spans: dict[str, Span] = {}
        self._buffer, self._at = buffer, 4

    def message(self, message: type[BaseModel], prefix: str) -> None:
        for field in fields(message):
            self._field(field, prefix + field.name)
        if not fields(message):
            self._at += 1

    def _field(self, field: Field, path: str) -> None:
        if field.kind == "one":
            self._one(field.element, path)
            return
        count = field.count if field.kind == "array" else self._count()
        if isinstance(field.element, Primitive) and field.element.size:
            self._numbers(field.element, count, path)
        else:
            for i in range(count):
                self._one(field.element, f"{path}[{i}]")

    def _one(self, element: Primitive | type[BaseModel], path: str) -> None:
        if not isinstance(element, Primitive):
            self.message(element, path + ".")
        elif element.size:
            self._numbers(element, 1, path)
        else:
            count = self._count()
            wide = element.name == "wstring"
            self.spans[path] = Span(self._at, 2 * count if wide else count - 1, element.name)
            self._at += 2 * count if wide else count

    def _numbers(self, element: Primitive, count: int, path: str) -> None:
        if count:
            self._at += (4 - self._at) % element.size
        self.spans[path] = Span(self._at, count, element.name)
        self._at += count * element.size

    def _count(self) -> int:
        self._at += -self._at & 3
        (count,) = struct.unpack_from("<I", self._buffer, self._at)
        self._at += 4
        return int(count)
