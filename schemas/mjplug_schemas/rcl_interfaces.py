"""The ROS package rcl_interfaces: the parameters and the log of nodes."""

from typing import Annotated, ClassVar

from pydantic import Field

from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.idl import (
    AtMost,
    boolean,
    byte_sequence,
    float64,
    int64,
    sequence,
    string,
    uint8,
    uint8_sequence,
    uint32,
    uint64,
)
from mjplug_schemas.message import Message, Service


class ParameterType(Message):
    """The types that a parameter can have."""

    PARAMETER_NOT_SET: ClassVar[uint8] = 0
    PARAMETER_BOOL: ClassVar[uint8] = 1
    PARAMETER_INTEGER: ClassVar[uint8] = 2
    PARAMETER_DOUBLE: ClassVar[uint8] = 3
    PARAMETER_STRING: ClassVar[uint8] = 4
    PARAMETER_BYTE_ARRAY: ClassVar[uint8] = 5
    PARAMETER_BOOL_ARRAY: ClassVar[uint8] = 6
    PARAMETER_INTEGER_ARRAY: ClassVar[uint8] = 7
    PARAMETER_DOUBLE_ARRAY: ClassVar[uint8] = 8
    PARAMETER_STRING_ARRAY: ClassVar[uint8] = 9


class ParameterValue(Message):
    """The value of a parameter: `type` says which of the fields counts."""

    type: uint8 = Field(0, description="One of the constants of ParameterType.")
    bool_value: boolean = Field(False, description="The value of a bool.")
    integer_value: int64 = Field(0, description="The value of an integer.")
    double_value: float64 = Field(0.0, description="The value of a double.")
    string_value: string = Field("", description="The value of a string.")
    byte_array_value: byte_sequence = Field(b"", description="The value of a byte array.")
    bool_array_value: sequence[boolean] = Field((), description="The value of a bool array.")
    integer_array_value: sequence[int64] = Field((), description="The value of an integer array.")
    double_array_value: sequence[float64] = Field((), description="The value of a double array.")
    string_array_value: sequence[string] = Field((), description="The value of a string array.")


class Parameter(Message):
    """A parameter with its value."""

    name: string = Field("", description="Its full name, with dots between its parts.")
    value: ParameterValue = Field(ParameterValue(), description="Its value.")


class FloatingPointRange(Message):
    """Which values a double may have."""

    from_value: float64 = Field(0.0, description="The least one.")
    to_value: float64 = Field(0.0, description="The greatest one.")
    step: float64 = Field(0.0, description="The distance between two of them; 0 allows all.")


class IntegerRange(Message):
    """Which values an integer may have."""

    from_value: int64 = Field(0, description="The least one.")
    to_value: int64 = Field(0, description="The greatest one.")
    step: uint64 = Field(0, description="The distance between two of them; 0 allows all.")


class ParameterDescriptor(Message):
    """What is known of a parameter besides its value."""

    name: string = Field("", description="Its full name.")
    type: uint8 = Field(0, description="Its type, one of the constants of ParameterType.")
    description: string = Field("", description="What it is for.")
    additional_constraints: string = Field("", description="Further rules for its value, for people to read.")
    read_only: boolean = Field(False, description="Whether it keeps the value that it started with.")
    dynamic_typing: boolean = Field(False, description="Whether its type may change.")
    floating_point_range: Annotated[sequence[FloatingPointRange], AtMost(1)] = Field(
        (), description="The range of a double, if it has one."
    )
    integer_range: Annotated[sequence[IntegerRange], AtMost(1)] = Field(
        (), description="The range of an integer, if it has one."
    )


class SetParametersResult(Message):
    """Whether a parameter was set."""

    successful: boolean = Field(False, description="Whether it was.")
    reason: string = Field("", description="Why not, for people to read.")


class ListParametersResult(Message):
    """The parameters that were found."""

    names: sequence[string] = Field((), description="Their full names.")
    prefixes: sequence[string] = Field((), description="The groups that they are in.")


class Log(Message):
    """One line of a node's log."""

    DEBUG: ClassVar[uint8] = 10
    INFO: ClassVar[uint8] = 20
    WARN: ClassVar[uint8] = 30
    ERROR: ClassVar[uint8] = 40
    FATAL: ClassVar[uint8] = 50

    stamp: Time = Field(Time(), description="When it was logged [s, ns].")
    level: uint8 = Field(0, description="How grave it is, one of DEBUG to FATAL.")
    name: string = Field("", description="The logger.")
    msg: string = Field("", description="The text.")
    file: string = Field("", description="The source file it comes from.")
    function: string = Field("", description="The function it comes from.")
    line: uint32 = Field(0, description="The line of the source file.")


class DescribeParameters(Service):
    """Tells what is known of parameters."""

    class Request(Message):
        """Which parameters."""

        names: sequence[string] = Field((), description="Their full names.")

    class Response(Message):
        """What is known of them."""

        descriptors: sequence[ParameterDescriptor] = Field((), description="One for each name, in their order.")


class GetParameters(Service):
    """Tells the values of parameters."""

    class Request(Message):
        """Which parameters."""

        names: sequence[string] = Field((), description="Their full names.")

    class Response(Message):
        """Their values."""

        values: sequence[ParameterValue] = Field((), description="One for each name, in their order.")


class GetParameterTypes(Service):
    """Tells the types of parameters."""

    class Request(Message):
        """Which parameters."""

        names: sequence[string] = Field((), description="Their full names.")

    class Response(Message):
        """Their types."""

        types: uint8_sequence = Field(b"", description="One for each name, in their order.")


class ListParameters(Service):
    """Finds parameters."""

    class Request(Message):
        """Where to look."""

        DEPTH_RECURSIVE: ClassVar[uint64] = 0

        prefixes: sequence[string] = Field((), description="The groups to look in; none means all.")
        depth: uint64 = Field(0, description="How many levels to go down; 0 is no limit.")

    class Response(Message):
        """What was found."""

        result: ListParametersResult = Field(ListParametersResult(), description="The parameters.")


class SetParameters(Service):
    """Sets parameters, one after the other."""

    class Request(Message):
        """What to set."""

        parameters: sequence[Parameter] = Field((), description="The parameters with their new values.")

    class Response(Message):
        """What became of it."""

        results: sequence[SetParametersResult] = Field((), description="One for each parameter, in their order.")


class SetParametersAtomically(Service):
    """Sets parameters, all of them or none."""

    class Request(Message):
        """What to set."""

        parameters: sequence[Parameter] = Field((), description="The parameters with their new values.")

    class Response(Message):
        """What became of it."""

        result: SetParametersResult = Field(SetParametersResult(), description="Whether all of them were set.")
