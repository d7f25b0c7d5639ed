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
    """The value of a parameter: `type` selects the field that is used."""

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
    """The allowed range of a double."""

    from_value: float64 = Field(0.0, description="Smallest value.")
    to_value: float64 = Field(0.0, description="Largest value.")
    step: float64 = Field(0.0, description="Step between allowed values; 0: all values are allowed.")


class IntegerRange(Message):
    """The allowed range of an integer."""

    from_value: int64 = Field(0, description="Smallest value.")
    to_value: int64 = Field(0, description="Largest value.")
    step: uint64 = Field(0, description="Step between allowed values; 0: all values are allowed.")


class ParameterDescriptor(Message):
    """Description of a parameter."""

    name: string = Field("", description="Its full name.")
    type: uint8 = Field(0, description="Its type, one of the constants of ParameterType.")
    description: string = Field("", description="Purpose of the parameter.")
    additional_constraints: string = Field("", description="Further constraints on the value, as text.")
    read_only: boolean = Field(False, description="Whether the value cannot be changed.")
    dynamic_typing: boolean = Field(False, description="Whether the type can change.")
    floating_point_range: Annotated[sequence[FloatingPointRange], AtMost(1)] = Field(
        (), description="The range of a double, if it has one."
    )
    integer_range: Annotated[sequence[IntegerRange], AtMost(1)] = Field(
        (), description="The range of an integer, if it has one."
    )


class SetParametersResult(Message):
    """Whether a parameter was set."""

    successful: boolean = Field(False, description="Whether the parameter was set.")
    reason: string = Field("", description="Reason of a failure, as text.")


class ListParametersResult(Message):
    """The parameters that were found."""

    names: sequence[string] = Field((), description="Their full names.")
    prefixes: sequence[string] = Field((), description="Their groups.")


class Log(Message):
    """One line of a node's log."""

    DEBUG: ClassVar[uint8] = 10
    INFO: ClassVar[uint8] = 20
    WARN: ClassVar[uint8] = 30
    ERROR: ClassVar[uint8] = 40
    FATAL: ClassVar[uint8] = 50

    stamp: Time = Field(Time(), description="Time of the log line [s, ns].")
    level: uint8 = Field(0, description="Severity, one of DEBUG to FATAL.")
    name: string = Field("", description="The logger.")
    msg: string = Field("", description="The text.")
    file: string = Field("", description="Source file.")
    function: string = Field("", description="Function.")
    line: uint32 = Field(0, description="Line in the source file.")


class DescribeParameters(Service):
    """Returns the descriptors of parameters."""

    class Request(Message):
        """The names of the parameters."""

        names: sequence[string] = Field((), description="Their full names.")

    class Response(Message):
        """The descriptors of the parameters."""

        descriptors: sequence[ParameterDescriptor] = Field((), description="One for each name, in their order.")


class GetParameters(Service):
    """Returns the values of parameters."""

    class Request(Message):
        """The names of the parameters."""

        names: sequence[string] = Field((), description="Their full names.")

    class Response(Message):
        """The values of the parameters."""

        values: sequence[ParameterValue] = Field((), description="One for each name, in their order.")


class GetParameterTypes(Service):
    """Returns the types of parameters."""

    class Request(Message):
        """The names of the parameters."""

        names: sequence[string] = Field((), description="Their full names.")

    class Response(Message):
        """The types of the parameters."""

        types: uint8_sequence = Field(b"", description="One for each name, in their order.")


class ListParameters(Service):
    """Lists parameters."""

    class Request(Message):
        """The groups of parameters to list."""

        DEPTH_RECURSIVE: ClassVar[uint64] = 0

        prefixes: sequence[string] = Field((), description="Groups to list; empty: all.")
        depth: uint64 = Field(0, description="Depth of nested groups; 0: unlimited.")

    class Response(Message):
        """The parameters."""

        result: ListParametersResult = Field(ListParametersResult(), description="The parameters.")


class SetParameters(Service):
    """Sets parameters one by one."""

    class Request(Message):
        """The parameters to set."""

        parameters: sequence[Parameter] = Field((), description="The parameters with their new values.")

    class Response(Message):
        """Whether the parameters were set."""

        results: sequence[SetParametersResult] = Field((), description="One for each parameter, in their order.")


class SetParametersAtomically(Service):
    """Sets all parameters or none."""

    class Request(Message):
        """The parameters to set."""

        parameters: sequence[Parameter] = Field((), description="The parameters with their new values.")

    class Response(Message):
        """Whether the parameters were set."""

        result: SetParametersResult = Field(SetParametersResult(), description="Whether all of them were set.")
