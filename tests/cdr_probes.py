"""Messages of no package, for what the real ones do not have."""

from typing import Annotated

from pydantic import Field

from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.geometry_msgs import Point
from mjplug_schemas.idl import (
    AtMost,
    Exactly,
    boolean,
    float64,
    int16,
    sequence,
    string,
    uint8,
    uint8_sequence,
    wstring,
)
from mjplug_schemas.message import Message
from mjplug_schemas.sensor_msgs import PointField
from mjplug_schemas.std_msgs import Empty


class DoublesByte(Message):
    a: sequence[float64] = Field(())
    b: uint8 = Field(0)


class DoublesDouble(Message):
    a: sequence[float64] = Field(())
    b: float64 = Field(0.0)


class Flags(Message):
    a: sequence[boolean] = Field(())
    b: float64 = Field(0.0)
    c: Annotated[sequence[boolean], Exactly(3)] = Field((False,) * 3)


class BytesFlag(Message):
    a: uint8_sequence = Field(b"")
    b: boolean = Field(False)


class ByteBytesDouble(Message):
    a: uint8 = Field(0)
    b: uint8_sequence = Field(b"")
    c: float64 = Field(0.0)


class PointFields(Message):
    p: sequence[PointField] = Field(())
    b: boolean = Field(False)


class Bounded(Message, package="probe"):
    name: Annotated[string, AtMost(5)] = Field("")
    few: Annotated[sequence[int16], AtMost(3)] = Field(())
    names: Annotated[sequence[Annotated[string, AtMost(5)]], AtMost(2)] = Field(())
    points: Annotated[sequence[Point], AtMost(2)] = Field(())
    data: Annotated[uint8_sequence, AtMost(4)] = Field(b"")
    times: Annotated[sequence[Time], Exactly(2)] = Field((Time(), Time()))


class Wide(Message):
    flag: boolean = Field(False)
    text: wstring = Field("")
    texts: sequence[wstring] = Field(())


class Blanks(Message):
    first: Empty = Field(Empty())
    many: sequence[Empty] = Field(())
    number: float64 = Field(0.0)
