"""The ROS package type_description_interfaces: descriptions of types (REP-2016)."""

from typing import Annotated, ClassVar

import pydantic

from mjplug_schemas.idl import AtMost, boolean, sequence, string, uint8, uint64
from mjplug_schemas.message import Message, Service


class FieldType(Message):
    """The type of one field."""

    FIELD_TYPE_NOT_SET: ClassVar[uint8] = 0
    FIELD_TYPE_NESTED_TYPE: ClassVar[uint8] = 1
    FIELD_TYPE_INT8: ClassVar[uint8] = 2
    FIELD_TYPE_UINT8: ClassVar[uint8] = 3
    FIELD_TYPE_INT16: ClassVar[uint8] = 4
    FIELD_TYPE_UINT16: ClassVar[uint8] = 5
    FIELD_TYPE_INT32: ClassVar[uint8] = 6
    FIELD_TYPE_UINT32: ClassVar[uint8] = 7
    FIELD_TYPE_INT64: ClassVar[uint8] = 8
    FIELD_TYPE_UINT64: ClassVar[uint8] = 9
    FIELD_TYPE_FLOAT: ClassVar[uint8] = 10
    FIELD_TYPE_DOUBLE: ClassVar[uint8] = 11
    FIELD_TYPE_LONG_DOUBLE: ClassVar[uint8] = 12
    FIELD_TYPE_CHAR: ClassVar[uint8] = 13
    FIELD_TYPE_WCHAR: ClassVar[uint8] = 14
    FIELD_TYPE_BOOLEAN: ClassVar[uint8] = 15
    FIELD_TYPE_BYTE: ClassVar[uint8] = 16
    FIELD_TYPE_STRING: ClassVar[uint8] = 17
    FIELD_TYPE_WSTRING: ClassVar[uint8] = 18
    FIELD_TYPE_FIXED_STRING: ClassVar[uint8] = 19
    FIELD_TYPE_FIXED_WSTRING: ClassVar[uint8] = 20
    FIELD_TYPE_BOUNDED_STRING: ClassVar[uint8] = 21
    FIELD_TYPE_BOUNDED_WSTRING: ClassVar[uint8] = 22
    FIELD_TYPE_NESTED_TYPE_ARRAY: ClassVar[uint8] = 49
    FIELD_TYPE_INT8_ARRAY: ClassVar[uint8] = 50
    FIELD_TYPE_UINT8_ARRAY: ClassVar[uint8] = 51
    FIELD_TYPE_INT16_ARRAY: ClassVar[uint8] = 52
    FIELD_TYPE_UINT16_ARRAY: ClassVar[uint8] = 53
    FIELD_TYPE_INT32_ARRAY: ClassVar[uint8] = 54
    FIELD_TYPE_UINT32_ARRAY: ClassVar[uint8] = 55
    FIELD_TYPE_INT64_ARRAY: ClassVar[uint8] = 56
    FIELD_TYPE_UINT64_ARRAY: ClassVar[uint8] = 57
    FIELD_TYPE_FLOAT_ARRAY: ClassVar[uint8] = 58
    FIELD_TYPE_DOUBLE_ARRAY: ClassVar[uint8] = 59
    FIELD_TYPE_LONG_DOUBLE_ARRAY: ClassVar[uint8] = 60
    FIELD_TYPE_CHAR_ARRAY: ClassVar[uint8] = 61
    FIELD_TYPE_WCHAR_ARRAY: ClassVar[uint8] = 62
    FIELD_TYPE_BOOLEAN_ARRAY: ClassVar[uint8] = 63
    FIELD_TYPE_BYTE_ARRAY: ClassVar[uint8] = 64
    FIELD_TYPE_STRING_ARRAY: ClassVar[uint8] = 65
    FIELD_TYPE_WSTRING_ARRAY: ClassVar[uint8] = 66
    FIELD_TYPE_FIXED_STRING_ARRAY: ClassVar[uint8] = 67
    FIELD_TYPE_FIXED_WSTRING_ARRAY: ClassVar[uint8] = 68
    FIELD_TYPE_BOUNDED_STRING_ARRAY: ClassVar[uint8] = 69
    FIELD_TYPE_BOUNDED_WSTRING_ARRAY: ClassVar[uint8] = 70
    FIELD_TYPE_NESTED_TYPE_BOUNDED_SEQUENCE: ClassVar[uint8] = 97
    FIELD_TYPE_INT8_BOUNDED_SEQUENCE: ClassVar[uint8] = 98
    FIELD_TYPE_UINT8_BOUNDED_SEQUENCE: ClassVar[uint8] = 99
    FIELD_TYPE_INT16_BOUNDED_SEQUENCE: ClassVar[uint8] = 100
    FIELD_TYPE_UINT16_BOUNDED_SEQUENCE: ClassVar[uint8] = 101
    FIELD_TYPE_INT32_BOUNDED_SEQUENCE: ClassVar[uint8] = 102
    FIELD_TYPE_UINT32_BOUNDED_SEQUENCE: ClassVar[uint8] = 103
    FIELD_TYPE_INT64_BOUNDED_SEQUENCE: ClassVar[uint8] = 104
    FIELD_TYPE_UINT64_BOUNDED_SEQUENCE: ClassVar[uint8] = 105
    FIELD_TYPE_FLOAT_BOUNDED_SEQUENCE: ClassVar[uint8] = 106
    FIELD_TYPE_DOUBLE_BOUNDED_SEQUENCE: ClassVar[uint8] = 107
    FIELD_TYPE_LONG_DOUBLE_BOUNDED_SEQUENCE: ClassVar[uint8] = 108
    FIELD_TYPE_CHAR_BOUNDED_SEQUENCE: ClassVar[uint8] = 109
    FIELD_TYPE_WCHAR_BOUNDED_SEQUENCE: ClassVar[uint8] = 110
    FIELD_TYPE_BOOLEAN_BOUNDED_SEQUENCE: ClassVar[uint8] = 111
    FIELD_TYPE_BYTE_BOUNDED_SEQUENCE: ClassVar[uint8] = 112
    FIELD_TYPE_STRING_BOUNDED_SEQUENCE: ClassVar[uint8] = 113
    FIELD_TYPE_WSTRING_BOUNDED_SEQUENCE: ClassVar[uint8] = 114
    FIELD_TYPE_FIXED_STRING_BOUNDED_SEQUENCE: ClassVar[uint8] = 115
    FIELD_TYPE_FIXED_WSTRING_BOUNDED_SEQUENCE: ClassVar[uint8] = 116
    FIELD_TYPE_BOUNDED_STRING_BOUNDED_SEQUENCE: ClassVar[uint8] = 117
    FIELD_TYPE_BOUNDED_WSTRING_BOUNDED_SEQUENCE: ClassVar[uint8] = 118
    FIELD_TYPE_NESTED_TYPE_UNBOUNDED_SEQUENCE: ClassVar[uint8] = 145
    FIELD_TYPE_INT8_UNBOUNDED_SEQUENCE: ClassVar[uint8] = 146
    FIELD_TYPE_UINT8_UNBOUNDED_SEQUENCE: ClassVar[uint8] = 147
    FIELD_TYPE_INT16_UNBOUNDED_SEQUENCE: ClassVar[uint8] = 148
    FIELD_TYPE_UINT16_UNBOUNDED_SEQUENCE: ClassVar[uint8] = 149
    FIELD_TYPE_INT32_UNBOUNDED_SEQUENCE: ClassVar[uint8] = 150
    FIELD_TYPE_UINT32_UNBOUNDED_SEQUENCE: ClassVar[uint8] = 151
    FIELD_TYPE_INT64_UNBOUNDED_SEQUENCE: ClassVar[uint8] = 152
    FIELD_TYPE_UINT64_UNBOUNDED_SEQUENCE: ClassVar[uint8] = 153
    FIELD_TYPE_FLOAT_UNBOUNDED_SEQUENCE: ClassVar[uint8] = 154
    FIELD_TYPE_DOUBLE_UNBOUNDED_SEQUENCE: ClassVar[uint8] = 155
    FIELD_TYPE_LONG_DOUBLE_UNBOUNDED_SEQUENCE: ClassVar[uint8] = 156
    FIELD_TYPE_CHAR_UNBOUNDED_SEQUENCE: ClassVar[uint8] = 157
    FIELD_TYPE_WCHAR_UNBOUNDED_SEQUENCE: ClassVar[uint8] = 158
    FIELD_TYPE_BOOLEAN_UNBOUNDED_SEQUENCE: ClassVar[uint8] = 159
    FIELD_TYPE_BYTE_UNBOUNDED_SEQUENCE: ClassVar[uint8] = 160
    FIELD_TYPE_STRING_UNBOUNDED_SEQUENCE: ClassVar[uint8] = 161
    FIELD_TYPE_WSTRING_UNBOUNDED_SEQUENCE: ClassVar[uint8] = 162
    FIELD_TYPE_FIXED_STRING_UNBOUNDED_SEQUENCE: ClassVar[uint8] = 163
    FIELD_TYPE_FIXED_WSTRING_UNBOUNDED_SEQUENCE: ClassVar[uint8] = 164
    FIELD_TYPE_BOUNDED_STRING_UNBOUNDED_SEQUENCE: ClassVar[uint8] = 165
    FIELD_TYPE_BOUNDED_WSTRING_UNBOUNDED_SEQUENCE: ClassVar[uint8] = 166

    type_id: uint8 = pydantic.Field(0, description="Which kind of type, as in REP-2016.")
    capacity: uint64 = pydantic.Field(0, description="The length of an array, or the bound of a sequence.")
    string_capacity: uint64 = pydantic.Field(0, description="The bound of a string.")
    nested_type_name: Annotated[string, AtMost(255)] = pydantic.Field(
        "", description="The name of a type that is no primitive one."
    )


class Field(Message):
    """One field of a type."""

    name: string = pydantic.Field("", description="Its name.")
    type: FieldType = pydantic.Field(FieldType(), description="Its type.")
    default_value: string = pydantic.Field("", description="Its default value, as in the definition.")


class IndividualTypeDescription(Message):
    """One type, without the types of its fields."""

    type_name: Annotated[string, AtMost(255)] = pydantic.Field("", description="Its name.")
    fields: sequence[Field] = pydantic.Field((), description="Its fields, in their order.")


class TypeDescription(Message):
    """One type with all types that its fields refer to."""

    type_description: IndividualTypeDescription = pydantic.Field(
        IndividualTypeDescription(), description="The type itself."
    )
    referenced_type_descriptions: sequence[IndividualTypeDescription] = pydantic.Field(
        (), description="The others, sorted by name."
    )


class TypeSource(Message):
    """The text that defines a type."""

    type_name: string = pydantic.Field("", description="Its name.")
    encoding: string = pydantic.Field("", description="Format: `msg`, `srv`, or `implicit` for no text.")
    raw_file_contents: string = pydantic.Field("", description="The text.")


class KeyValue(Message):
    """Additional information."""

    key: string = pydantic.Field("", description="What it is.")
    value: string = pydantic.Field("", description="Its value.")


class GetTypeDescription(Service):
    """Returns the description of a type."""

    class Request(Message):
        """The type to describe."""

        type_name: string = pydantic.Field("", description="Its name, such as `std_msgs/msg/String`.")
        type_hash: string = pydantic.Field("", description="Its RIHS01 hash, as in the ROS graph.")
        include_type_sources: boolean = pydantic.Field(
            True, description="Whether the response contains the definitions."
        )

    class Response(Message):
        """The description of the type."""

        successful: boolean = pydantic.Field(False, description="Whether the type was found.")
        failure_reason: string = pydantic.Field("", description="Reason of a failure, as text.")
        type_description: TypeDescription = pydantic.Field(TypeDescription(), description="The type.")
        type_sources: sequence[TypeSource] = pydantic.Field((), description="The definitions.")
        extra_information: sequence[KeyValue] = pydantic.Field(
            (), description="Additional information; always empty here."
        )
