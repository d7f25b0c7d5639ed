"""The operations of a CDR plan for sequences and arrays."""

import struct
import sys
from collections.abc import Callable, Iterator
from operator import attrgetter
from typing import Any, NamedTuple

from mjplug_schemas.cdr_operations import ZEROS, Fault, Operation, Text, shortage
from mjplug_schemas.idl import Primitive

_NATIVE = "<" if sys.byteorder == "little" else ">"
"""The byte order of this machine."""


_MAX_KEPT_SIZE = 512
"""Maximum size of the end of a message whose values are kept [bytes]."""

_MAX_KEPT = 64
"""Maximum number of ends that are kept for each type and alignment."""


class Extent(NamedTuple):
    """The allowed number of elements.

    Attributes:
        length: Length of an array; None for a sequence, whose count is transmitted.
        bound: Bound of a sequence; 0: unbounded.
    """

    length: int | None
    bound: int


class Element(NamedTuple):
    """The type of the messages in a sequence or array.

    Attributes:
        plan: Operations that write and read one element.
        build: Builds one element from the values that `plan` reads.
        min_size: Smallest size of one element [bytes].
    """

    plan: tuple[Operation, ...]
    build: Callable[[Iterator[Any]], Any]
    min_size: int


class Counted:
    """Base class of sequences and arrays; writes and reads the number of elements.

    Args:
        path: Path of the field.
        order: The byte order, `<` or `>`.
        extent: Allowed number of elements.
    """

    def __init__(self, path: str, order: str, extent: Extent) -> None:
        self._path, self._order = path, order
        self._length, self._bound = extent
        self._get = attrgetter(path)
        self._count = struct.Struct(order + "I")

    def _write_count(self, out: bytearray, count: int) -> None:
        if self._length is None:
            self._check_bound(count, None)
            out += ZEROS[-len(out) & 3] + self._count.pack(count)
        elif count != self._length:
            raise Fault(self._path, f"expected {self._length} elements, got {count}")

    def _read_count(self, source: bytes, at: int) -> tuple[int, int]:
        if self._length is not None:
            return self._length, at
        at += -at & 3
        try:
            (count,) = self._count.unpack_from(source, at)
        except struct.error:
            raise shortage(self._path, at, "a count of elements", 4, source) from None
        self._check_bound(count, at)
        return count, at + 4

    def _check_bound(self, count: int, at: int | None) -> None:
        if self._bound and count > self._bound:
            raise Fault(self._path, f"expected at most {self._bound} elements, got {count}", at)


class Numbers(Counted):
    """A sequence or array of numbers: a tuple, or a memoryview of numbers of this type in this machine's byte order.

    Args:
        path: As in the base class.
        order: As in the base class.
        extent: As in the base class.
        primitive: The type of the numbers.
        packed: Whether memoryviews are read, where the byte order is that of this machine.
    """

    def __init__(self, path: str, order: str, extent: Extent, primitive: Primitive, packed: bool = False) -> None:
        super().__init__(path, order, extent)
        self._primitive, self._size = primitive, primitive.size
        self._native = order == _NATIVE and primitive.code != "?"
        self._packed = packed and self._native
        self._reader = primitive.code.replace("?", "B")

    def write(self, out: bytearray, message: Any) -> None:
        """Appends the numbers."""
        values = self._get(message)
        self._write_count(out, len(values))
        if not len(values):
            return
        if self._native and type(values) is memoryview and values.format == self._primitive.code:
            out += ZEROS[(4 - len(out)) % self._size]
            out += values.cast("B")
            return
        try:
            numbers = struct.pack(f"{self._order}{len(values)}{self._primitive.code}", *values)
        except (struct.error, OverflowError) as error:
            raise Fault(self._path, f"not all elements are of type {self._primitive.name}: {error}") from None
        out += ZEROS[(4 - len(out)) % self._size] + numbers

    def read(self, source: bytes, at: int, values: list[Any]) -> int:
        """Reads the numbers."""
        count, at = self._read_count(source, at)
        if count == 0 and not self._packed:
            values.append(())
            return at
        if count == 0:
            values.append(_numbers(memoryview(b""), self._primitive))
            return at
        at += (4 - at) % self._size
        end = at + count * self._size
        if end > len(source):
            raise shortage(self._path, at, f"{count} {self._primitive.name} values", count * self._size, source)
        if self._packed:
            values.append(_numbers(memoryview(source)[at:end], self._primitive))
            return end
        numbers = struct.unpack_from(f"{self._order}{count}{self._reader}", source, at)
        if self._primitive.code == "?":
            numbers = self._flags(numbers, at)
        values.append(numbers)
        return end

    def _flags(self, numbers: tuple[int, ...], at: int) -> tuple[bool, ...]:
        for i, number in enumerate(numbers):
            if number > 1:
                raise Fault(f"{self._path}[{i}]", f"expected a bool (0 or 1), got {number}", at + i)
        return tuple(map(bool, numbers))


class Octets(Counted):
    """A sequence or array of bytes."""

    def write(self, out: bytearray, message: Any) -> None:
        """Appends the bytes."""
        octets = self._get(message)
        self._write_count(out, len(octets))
        out += octets

    def read(self, source: bytes, at: int, values: list[Any]) -> int:
        """Reads the bytes."""
        count, at = self._read_count(source, at)
        end = at + count
        if end > len(source):
            raise shortage(self._path, at, f"{count} bytes", count, source)
        values.append(source[at:end])
        return end


class Texts(Counted):
    """A sequence or array of strings; unbounded UTF-8 strings are converted all at once, the others one by one."""

    def __init__(self, path: str, order: str, extent: Extent, text: Text) -> None:
        super().__init__(path, order, extent)
        self._text = text

    def write(self, out: bytearray, message: Any) -> None:
        """Appends the strings."""
        texts = self._get(message)
        self._write_count(out, len(texts))
        raws = self._encoded(texts)
        if raws is None:
            for i, text in enumerate(texts):
                self._text.write_one(out, text, f"{self._path}[{i}]")
            return
        out += ZEROS[-len(out) & 3]
        pack, size = self._count.pack, 0
        for raw in raws:
            size = len(raw)
            out += pack(size + 1)
            out += raw
            out += ZEROS[4 - (size & 3)]
        # The padding after the last string is not needed; its NUL stays.
        del out[len(out) - (3 - (size & 3)) :]

    def _encoded(self, texts: tuple[str, ...]) -> list[bytes] | None:
        if not texts or self._text.special:
            return None
        try:
            raws = "\0".join(texts).encode().split(b"\0")
        except (TypeError, UnicodeEncodeError):
            return None
        return raws if len(raws) == len(texts) else None

    def read(self, source: bytes, at: int, values: list[Any]) -> int:
        """Reads the strings."""
        count, at = self._read_count(source, at)
        if count * 4 > len(source) - at:
            raise shortage(self._path, at, f"{count} strings", count * 4, source)
        if count and not self._text.special and (decoded := self._decoded(source, at, count)):
            texts, at = decoded
        else:
            texts = []
            for i in range(count):
                text, at = self._text.read_one(source, at, f"{self._path}[{i}]")
                texts.append(text)
        values.append(tuple(texts))
        return at

    def _decoded(self, source: bytes, at: int, count: int) -> tuple[list[str], int] | None:
        raws = []
        end, size, unpack = at, len(source), self._count.unpack_from
        try:
            for _ in range(count):
                at = (end + 7) & -4
                end = at + unpack(source, at - 4)[0]
                if end > size or source[end - 1]:
                    return None
                raws.append(source[at:end])
            texts = b"".join(raws).decode().split("\0")
        except (struct.error, UnicodeDecodeError):
            return None
        # The part after the last NUL is empty. Another number of parts means a missing or additional NUL.
        return (texts[:-1], end) if len(texts) == count + 1 else None


class Structs(Counted):
    """A sequence or array of messages."""

    def __init__(self, path: str, order: str, extent: Extent, element: Element) -> None:
        super().__init__(path, order, extent)
        self._plan, self._build, self._min_size = element

    def write(self, out: bytearray, message: Any) -> None:
        """Appends the messages."""
        elements = self._get(message)
        self._write_count(out, len(elements))
        for i, element in enumerate(elements):
            try:
                for operation in self._plan:
                    operation.write(out, element)
            except Fault as fault:
                raise fault.within(f"{self._path}[{i}]") from None

    def read(self, source: bytes, at: int, values: list[Any]) -> int:
        """Reads the messages."""
        count, at = self._read_count(source, at)
        if count * self._min_size > len(source) - at:
            raise shortage(self._path, at, f"{count} elements", count * self._min_size, source)
        parts: list[Any] = []
        for i in range(count):
            try:
                for operation in self._plan:
                    at = operation.read(source, at, parts)
            except Fault as fault:
                raise fault.within(f"{self._path}[{i}]") from None
        queue = iter(parts)
        values.append(tuple([self._build(queue) for _ in range(count)]))
        return at


class Rest:
    """The operations after the first sequence of numbers, when messages are read packed.

    Clients that repeat a request change its numbers, but hardly ever its names. The values of the last different ends
    are therefore kept; they are immutable, so several messages may share them.

    Args:
        plan: The operations.
    """

    def __init__(self, plan: tuple[Operation, ...]) -> None:
        self._plan = plan
        # One dictionary for each alignment.
        self._known: list[dict[bytes, tuple[int, list[Any]]]] = [{} for _ in range(8)]

    def write(self, out: bytearray, message: Any) -> None:
        """Appends the values."""
        for operation in self._plan:
            operation.write(out, message)

    def read(self, source: bytes, at: int, values: list[Any]) -> int:
        """Reads the values."""
        size = len(source) - at
        if size > _MAX_KEPT_SIZE:
            return self._read(source, at, values)
        known, end = self._known[at & 7], source[at:]
        found = known.get(end)
        if found is None:
            # Read from a copy, of the same alignment, because memoryviews would keep the whole message in memory.
            shift = at & 7
            kept: list[Any] = []
            try:
                length = self._read(bytes(shift) + end, shift, kept) - shift
            except Fault:
                # Raises an error with the position in the message.
                return self._read(source, at, values)
            if len(known) >= _MAX_KEPT:
                known.clear()
            found = known[end] = length, kept
        length, kept = found
        values += kept
        return at + length

    def _read(self, source: bytes, at: int, values: list[Any]) -> int:
        for operation in self._plan:
            at = operation.read(source, at, values)
        return at


def _numbers(source: memoryview, primitive: Primitive) -> Any:
    # The stubs of `cast` accept literal codes only.
    cast: Any = source.cast
    return cast(primitive.code)
