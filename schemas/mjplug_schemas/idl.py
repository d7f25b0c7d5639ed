"""ROS 2 interface definitions as Python annotations: primitive types, sequences, arrays and bounds.

| `.msg` file | Annotation |
|---|---|
| `float64 x` | `x: float64` |
| `string<=16 s` | `s: Annotated[string, AtMost(16)]` |
| `float64[] a`, `Point[] a` | `a: sequence[float64]`, `a: sequence[Point]` |
| `float64[<=3] a` | `a: Annotated[sequence[float64], AtMost(3)]` |
| `float64[36] a` | `a: Annotated[sequence[float64], Exactly(36)]` |
| `uint8[] d`, `byte[] d`, `char[] d` | `d: uint8_sequence`, `byte_sequence`, `char_sequence` |

Sequences are tuples, and the three types of one-byte sequences are `bytes`. Numpy scalars and arrays are accepted as
numbers. Values are not converted: `"5"` and `true` are not numbers, 1.0 is not an integer.
"""

from dataclasses import dataclass
from typing import Annotated, Any, TypeVar

from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from mjplug_schemas import validate

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Primitive:
    """A primitive type of ROS; as an annotation, it validates values.

    Attributes:
        name: Name in a `.msg` file.
        code: Code in the module `struct`; empty for strings.
        size: Size and alignment in CDR [bytes]; 0 for strings.
        hash_id: Type id in a type description (REP-2016).
    """

    name: str
    code: str
    size: int
    hash_id: int

    @property
    def limits(self) -> tuple[int, int]:
        """The smallest and the largest value of an integer type."""
        if self.code.isupper():
            return 0, 2 ** (8 * self.size) - 1
        return -(2 ** (8 * self.size - 1)), 2 ** (8 * self.size - 1) - 1

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        if self.name in ("string", "wstring"):
            return validate.text(self.name)
        if self.name == "bool":
            return validate.scalar(self.name, "true or false", core_schema.bool_schema(strict=True))
        if self.name == "float64":
            return validate.scalar(self.name, "a number", validate.number())
        if self.name == "float32":
            return validate.float32()
        low, high = self.limits
        schema = core_schema.int_schema(strict=True, ge=low, le=high)
        return validate.scalar(self.name, f"an integer from {low} to {high}", schema)


@dataclass(frozen=True, slots=True)
class Sequence:
    """Marks a tuple (or, with `element`, bytes) as a ROS sequence."""

    element: Primitive | None = None

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        if self.element is not None:
            return validate.octets(self.element.name)
        item = source.__args__[0]
        metadata = getattr(item, "__metadata__", ())
        if FLOAT32 in metadata:
            return validate.float32_sequence()
        return validate.sequence(handler.generate_schema(item))


@dataclass(frozen=True, slots=True)
class AtMost:
    """An upper bound: number of UTF-8 bytes of a string, or number of elements of a sequence."""

    count: int

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return validate.bounded(handler(source), 0, self.count)


@dataclass(frozen=True, slots=True)
class Exactly:
    """Makes a sequence an array with a fixed number of elements, whose count is not transmitted."""

    count: int

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return validate.bounded(handler(source), self.count, self.count)


BOOL = Primitive("bool", "?", 1, 15)
BYTE = Primitive("byte", "B", 1, 16)
# In ROS 2, char is an unsigned byte with the type id of uint8.
CHAR = Primitive("char", "B", 1, 3)
INT8 = Primitive("int8", "b", 1, 2)
UINT8 = Primitive("uint8", "B", 1, 3)
INT16 = Primitive("int16", "h", 2, 4)
UINT16 = Primitive("uint16", "H", 2, 5)
INT32 = Primitive("int32", "i", 4, 6)
UINT32 = Primitive("uint32", "I", 4, 7)
INT64 = Primitive("int64", "q", 8, 8)
UINT64 = Primitive("uint64", "Q", 8, 9)
FLOAT32 = Primitive("float32", "f", 4, 10)
FLOAT64 = Primitive("float64", "d", 8, 11)
STRING = Primitive("string", "", 0, 17)
WSTRING = Primitive("wstring", "", 0, 18)

boolean = Annotated[bool, BOOL]
byte = Annotated[int, BYTE]
char = Annotated[int, CHAR]
int8 = Annotated[int, INT8]
uint8 = Annotated[int, UINT8]
int16 = Annotated[int, INT16]
uint16 = Annotated[int, UINT16]
int32 = Annotated[int, INT32]
uint32 = Annotated[int, UINT32]
int64 = Annotated[int, INT64]
uint64 = Annotated[int, UINT64]
float32 = Annotated[float, FLOAT32]
float64 = Annotated[float, FLOAT64]
string = Annotated[str, STRING]
wstring = Annotated[str, WSTRING]

sequence = Annotated[tuple[T, ...], Sequence()]
byte_sequence = Annotated[bytes, Sequence(BYTE)]
char_sequence = Annotated[bytes, Sequence(CHAR)]
uint8_sequence = Annotated[bytes, Sequence(UINT8)]
