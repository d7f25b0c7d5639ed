"""The ROS package std_msgs: headers, colours, single values and arrays of numbers."""

from pydantic import Field

from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.idl import (
    boolean,
    byte,
    byte_sequence,
    char,
    float32,
    float64,
    int8,
    int16,
    int32,
    int64,
    sequence,
    string,
    uint8,
    uint8_sequence,
    uint16,
    uint32,
    uint64,
)
from mjplug_schemas.message import Message


class Header(Message):
    """The time and the coordinate frame of a message."""

    stamp: Time = Field(Time(), description="The time of the data, in simulated time since the start [s, ns].")
    frame_id: string = Field("", description="The coordinate frame of the data.")


class Empty(Message):
    """A message without data, used as a signal."""


class ColorRGBA(Message):
    """A colour with its opacity."""

    r: float32 = Field(0.0, description="Red, from 0 to 1.")
    g: float32 = Field(0.0, description="Green, from 0 to 1.")
    b: float32 = Field(0.0, description="Blue, from 0 to 1.")
    a: float32 = Field(0.0, description="Opacity, from 0 (invisible) to 1.")


class String(Message):
    """One text."""

    data: string = Field("", description="The text.")


class Bool(Message):
    """One boolean value."""

    data: boolean = Field(False, description="The value.")


class Byte(Message):
    """One byte, from 0 to 255."""

    data: byte = Field(0, description="The value.")


class Char(Message):
    """One character code, from 0 to 255."""

    data: char = Field(0, description="The value.")


class Float32(Message):
    """One number in single precision."""

    data: float32 = Field(0.0, description="The value.")


class Float64(Message):
    """One number in double precision."""

    data: float64 = Field(0.0, description="The value.")


class Int8(Message):
    """One signed integer of 8 bits."""

    data: int8 = Field(0, description="The value.")


class Int16(Message):
    """One signed integer of 16 bits."""

    data: int16 = Field(0, description="The value.")


class Int32(Message):
    """One signed integer of 32 bits."""

    data: int32 = Field(0, description="The value.")


class Int64(Message):
    """One signed integer of 64 bits."""

    data: int64 = Field(0, description="The value.")


class UInt8(Message):
    """One unsigned integer of 8 bits."""

    data: uint8 = Field(0, description="The value.")


class UInt16(Message):
    """One unsigned integer of 16 bits."""

    data: uint16 = Field(0, description="The value.")


class UInt32(Message):
    """One unsigned integer of 32 bits."""

    data: uint32 = Field(0, description="The value.")


class UInt64(Message):
    """One unsigned integer of 64 bits."""

    data: uint64 = Field(0, description="The value.")


class MultiArrayDimension(Message):
    """One dimension of a multi-dimensional array."""

    label: string = Field("", description="The name of the dimension.")
    size: uint32 = Field(0, description="How many elements it has.")
    stride: uint32 = Field(0, description="How many numbers one step in the dimension before this one spans.")


class MultiArrayLayout(Message):
    """The layout of a multi-dimensional array in a flat list."""

    dim: sequence[MultiArrayDimension] = Field((), description="The dimensions, the outermost first.")
    data_offset: uint32 = Field(0, description="How many numbers to skip at the start of the data.")


class ByteMultiArray(Message):
    """A multi-dimensional array of bytes."""

    layout: MultiArrayLayout = Field(MultiArrayLayout(), description="The dimensions of the array.")
    data: byte_sequence = Field(b"", description="The numbers, row by row.")


class Float32MultiArray(Message):
    """A multi-dimensional array of numbers in single precision."""

    layout: MultiArrayLayout = Field(MultiArrayLayout(), description="The dimensions of the array.")
    data: sequence[float32] = Field((), description="The numbers, row by row.")


class Float64MultiArray(Message):
    """A multi-dimensional array of numbers in double precision."""

    layout: MultiArrayLayout = Field(MultiArrayLayout(), description="The dimensions of the array.")
    data: sequence[float64] = Field((), description="The numbers, row by row.")


class Int8MultiArray(Message):
    """A multi-dimensional array of signed integers of 8 bits."""

    layout: MultiArrayLayout = Field(MultiArrayLayout(), description="The dimensions of the array.")
    data: sequence[int8] = Field((), description="The numbers, row by row.")


class Int16MultiArray(Message):
    """A multi-dimensional array of signed integers of 16 bits."""

    layout: MultiArrayLayout = Field(MultiArrayLayout(), description="The dimensions of the array.")
    data: sequence[int16] = Field((), description="The numbers, row by row.")


class Int32MultiArray(Message):
    """A multi-dimensional array of signed integers of 32 bits."""

    layout: MultiArrayLayout = Field(MultiArrayLayout(), description="The dimensions of the array.")
    data: sequence[int32] = Field((), description="The numbers, row by row.")


class Int64MultiArray(Message):
    """A multi-dimensional array of signed integers of 64 bits."""

    layout: MultiArrayLayout = Field(MultiArrayLayout(), description="The dimensions of the array.")
    data: sequence[int64] = Field((), description="The numbers, row by row.")


class UInt8MultiArray(Message):
    """A multi-dimensional array of unsigned integers of 8 bits."""

    layout: MultiArrayLayout = Field(MultiArrayLayout(), description="The dimensions of the array.")
    data: uint8_sequence = Field(b"", description="The numbers, row by row.")


class UInt16MultiArray(Message):
    """A multi-dimensional array of unsigned integers of 16 bits."""

    layout: MultiArrayLayout = Field(MultiArrayLayout(), description="The dimensions of the array.")
    data: sequence[uint16] = Field((), description="The numbers, row by row.")


class UInt32MultiArray(Message):
    """A multi-dimensional array of unsigned integers of 32 bits."""

    layout: MultiArrayLayout = Field(MultiArrayLayout(), description="The dimensions of the array.")
    data: sequence[uint32] = Field((), description="The numbers, row by row.")


class UInt64MultiArray(Message):
    """A multi-dimensional array of unsigned integers of 64 bits."""

    layout: MultiArrayLayout = Field(MultiArrayLayout(), description="The dimensions of the array.")
    data: sequence[uint64] = Field((), description="The numbers, row by row.")
