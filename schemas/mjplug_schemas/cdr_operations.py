"""The operations of a CDR plan; each operation writes and reads one part of a message.

`at` and `len(out)` are offsets from the start of the buffer. The 4-byte header does not change the alignment to 1, 2
and 4 bytes; alignment to 8 bytes is relative to the end of the header.
"""

import reprlib
import struct
from collections.abc import Callable, Iterator
from operator import attrgetter
from typing import Any, NamedTuple, Protocol

from mjplug_schemas.idl import Primitive

ZEROS = [bytes(n) for n in range(8)]


class Fault(Exception):
    """An invalid value or invalid bytes.

    Args:
        path: Path of the field in the message that is read or written.
        problem: Description of the problem.
        at: Offset in the buffer [bytes]; None when writing.
    """

    def __init__(self, path: str, problem: str, at: int | None = None) -> None:
        where = path if at is None else f"{path} at byte {at}".lstrip()
        super().__init__(f"{where}: {problem}")
        self.path, self.problem, self.at = path, problem, at

    def within(self, outer: str) -> "Fault":
        """Returns the fault with its path relative to the message that contains this one in the field `outer`."""
        return Fault(f"{outer}.{self.path}" if self.path else outer, self.problem, self.at)


class Operation(Protocol):
    """One operation of a plan."""

    def write(self, out: bytearray, message: Any) -> None:
        """Appends this part of the message."""

    def read(self, source: bytes, at: int, values: list[Any]) -> int:
        """Appends the values at an offset and returns the offset after them."""


class Number(NamedTuple):
    """One number in a run."""

    path: str
    primitive: Primitive


class Run:
    """A run of numbers, also across nested messages: one `struct` call with padding in its format."""

    def __init__(self, numbers: list[Number], order: str) -> None:
        self._numbers = tuple(numbers)
        self._order = order
        paths = [number.path for number in numbers]
        get = attrgetter(*paths)
        self._values: Callable[[Any], tuple[Any, ...]] = get if len(paths) > 1 else lambda message: (get(message),)
        self._flags = [i for i, number in enumerate(numbers) if number.primitive.code == "?"]
        self._writers = [self._layout(start, "?") for start in range(8)]
        self._readers = [self._layout(start, "B") for start in range(8)]

    def _layout(self, start: int, flag: str) -> struct.Struct:
        form, at = self._order, start
        for _, primitive in self._numbers:
            padding = -at % primitive.size
            form += "x" * padding + primitive.code.replace("?", flag)
            at += padding + primitive.size
        return struct.Struct(form)

    def write(self, out: bytearray, message: Any) -> None:
        """Appends the numbers."""
        try:
            out += self._writers[len(out) + 4 & 7].pack(*self._values(message))
        except (struct.error, OverflowError, AttributeError) as error:
            raise self._misfit(message, error) from None

    def read(self, source: bytes, at: int, values: list[Any]) -> int:
        """Reads the numbers."""
        reader = self._readers[at + 4 & 7]
        try:
            numbers: tuple[Any, ...] = reader.unpack_from(source, at)
        except struct.error:
            raise self._shortage(source, at) from None
        if self._flags:
            numbers = self._flagged(numbers, at)
        values += numbers
        return at + reader.size

    def _places(self, at: int) -> Iterator[tuple[int, Number]]:
        for number in self._numbers:
            at += (4 - at) % number.primitive.size
            yield at, number
            at += number.primitive.size

    def _flagged(self, numbers: tuple[Any, ...], at: int) -> tuple[Any, ...]:
        converted = list(numbers)
        for i in self._flags:
            if converted[i] > 1:
                place, number = list(self._places(at))[i]
                raise Fault(number.path, f"expected a bool (0 or 1), got {converted[i]}", place)
            converted[i] = converted[i] == 1
        return tuple(converted)

    def _shortage(self, source: bytes, at: int) -> Fault:
        place, number = next(p for p in self._places(at) if p[0] + p[1].primitive.size > len(source))
        return shortage(number.path, place, number.primitive.name, number.primitive.size, source)

    def _misfit(self, message: Any, error: Exception) -> Fault:
        for path, primitive in self._numbers:
            try:
                value = attrgetter(path)(message)
                struct.pack("<" + primitive.code, value)
            except (struct.error, OverflowError):
                return Fault(path, f"{reprlib.repr(value)} is not of type {primitive.name}")
            except AttributeError as missing:
                return Fault(path, str(missing))
        return Fault(self._numbers[0].path, str(error))


class Blank:
    """The zero byte of a message without fields."""

    def __init__(self, path: str) -> None:
        self._path = path

    def write(self, out: bytearray, message: Any) -> None:
        """Appends the byte."""
        out.append(0)

    def read(self, source: bytes, at: int, values: list[Any]) -> int:
        """Reads the byte."""
        if at >= len(source):
            raise shortage(self._path, at, "the zero byte of an empty message", 1, source)
        return at + 1


class Text:
    """One string: a length that counts the closing NUL, UTF-8, NUL.

    A wstring has its number of 2-byte UTF-16 units and no NUL, as in Fast-CDR 2. A length of 0 is read as an empty
    string, as Fast-CDR does. NUL inside a string is refused both ways: Fast-CDR refuses to write it.
    """

    def __init__(self, path: str, order: str, bound: int, wide: bool) -> None:
        self.path = path
        self.special = bound > 0 or wide
        self._bound = bound
        self._get = attrgetter(path)
        self._length = struct.Struct(order + "I")
        self._encoding = "utf-8" if not wide else "utf-16-le" if order == "<" else "utf-16-be"
        self._wide = wide

    def write(self, out: bytearray, message: Any) -> None:
        """Appends the string."""
        self.write_one(out, self._get(message), self.path)

    def write_one(self, out: bytearray, text: str, path: str) -> None:
        """Appends a string with its padding."""
        try:
            raw = text.encode(self._encoding)
        except UnicodeEncodeError:
            raise Fault(path, f"{reprlib.repr(text)} contains lone surrogates, which cannot be encoded") from None
        if "\0" in text:
            raise Fault(path, f"{reprlib.repr(text)} contains NUL, which terminates a string")
        if self._bound and len(text.encode()) > self._bound:
            raise Fault(path, f"expected at most {self._bound} bytes of UTF-8, got {len(text.encode())}")
        if self._wide:
            out += ZEROS[-len(out) & 3] + self._length.pack(len(raw) // 2) + raw
        else:
            out += b"%b%b%b\0" % (ZEROS[-len(out) & 3], self._length.pack(len(raw) + 1), raw)

    def read(self, source: bytes, at: int, values: list[Any]) -> int:
        """Reads the string."""
        text, at = self.read_one(source, at, self.path)
        values.append(text)
        return at

    def read_one(self, source: bytes, at: int, path: str) -> tuple[str, int]:
        """Returns the string at an offset, and the offset after it."""
        at += -at & 3
        try:
            (length,) = self._length.unpack_from(source, at)
        except struct.error:
            raise shortage(path, at, "the length of a string", 4, source) from None
        at += 4
        end = at + (2 * length if self._wide else length)
        if end > len(source):
            raise shortage(path, at, f"a string of length {length}", end - at, source)
        raw = source[at:end]
        if not self._wide and raw:
            if raw[-1]:
                raise Fault(path, "expected a string that ends with NUL", end - 1)
            raw = raw[:-1]
        try:
            text = raw.decode(self._encoding)
        except UnicodeDecodeError as error:
            raise Fault(
                path,
                f"expected {self._encoding.upper()}, got {raw[error.start : error.end].hex(' ')}",
                at + error.start,
            ) from None
        if "\0" in text:
            raise Fault(path, "expected a string without NUL", at)
        if self._bound and len(raw) > self._bound:
            raise Fault(path, f"expected at most {self._bound} bytes of UTF-8, got {len(raw)}", at)
        return text, end


def shortage(path: str, at: int, expected: str, size: int, source: bytes) -> Fault:
    """Returns the fault for truncated bytes."""
    left = max(0, len(source) - at)
    return Fault(path, f"expected {expected}, {_bytes(size)} or more, but {_bytes(left)} remain", at)


def _bytes(count: int) -> str:
    return f"{count} byte{'' if count == 1 else 's'}"
