"""Validation of ROS values: the pydantic-core schemas behind the annotations in `mjplug_schemas.idl`.

For an invalid value, a schema reports one error whose message says what is allowed. Errors of type `ros` are about the
whole value, which the caller adds to the text; errors of type `ros_part` already name the invalid part.
"""

import base64
import binascii
import reprlib
import struct
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from pydantic_core import CoreSchema, PydanticCustomError, core_schema

_SINGLE = struct.Struct("<f")


def _must(rule: str, of_part: bool = False) -> PydanticCustomError:
    return PydanticCustomError("ros_part" if of_part else "ros", "must {rule}", {"rule": rule})


def _with_rule(schema: CoreSchema, expected: str) -> CoreSchema:
    """Returns the schema with a single error message for all its errors."""
    context = {"rule": f"be {expected}"}
    return core_schema.custom_error_schema(
        schema, custom_error_type="ros", custom_error_message="must {rule}", custom_error_context=context
    )


def _article(name: str) -> str:
    return f"{'an' if name.startswith('int') else 'a'} {name}"


def scalar(name: str, meaning: str, schema: CoreSchema) -> CoreSchema:
    """Returns the schema of a number: `schema` for JSON; for Python values, numpy scalars are accepted too."""
    unwrapped = core_schema.no_info_before_validator_function(_item, schema)
    python = core_schema.union_schema([schema, unwrapped], mode="left_to_right")
    return _with_rule(core_schema.json_or_python_schema(schema, python), f"{_article(name)} ({meaning})")


def _item(value: Any) -> Any:
    return value.item() if getattr(value, "shape", None) == () else value


def number() -> CoreSchema:
    """Returns the schema of a floating-point number; in JSON, texts represent NaN and infinities.

    The texts are those of protobuf's JSON mapping (https://protobuf.dev/programming-guides/json/). The unquoted `NaN`
    and `Infinity` that Python writes are accepted too.
    """
    plain = core_schema.float_schema(strict=True)
    words = core_schema.no_info_after_validator_function(
        float, core_schema.literal_schema(["NaN", "Infinity", "-Infinity"])
    )
    return core_schema.json_or_python_schema(
        core_schema.union_schema([plain, words], mode="left_to_right"),
        plain,
        serialization=core_schema.simple_ser_schema("float"),
    )


def float32() -> CoreSchema:
    """Returns the schema of a float32; values are rounded, so that a message does not change when it is transmitted."""
    schema = core_schema.no_info_after_validator_function(_round, number())
    return scalar("float32", "a number no larger than 3.4028235e38", schema)


def _round(value: float) -> float:
    try:
        return float(_SINGLE.unpack(_SINGLE.pack(value))[0])
    except OverflowError:
        raise ValueError(value) from None


def float32_sequence() -> CoreSchema:
    """Returns the schema of a sequence of float32; all values are rounded at once."""
    numbers = scalar("float32", "a number no larger than 3.4028235e38", number())
    return core_schema.no_info_after_validator_function(_round_all, sequence(numbers))


def _round_all(values: tuple[float, ...]) -> tuple[float, ...]:
    singles = struct.Struct(f"<{len(values)}f")
    try:
        return singles.unpack(singles.pack(*values))
    except OverflowError:
        index = next(i for i, value in enumerate(values) if value - value == 0 and abs(value) >= 3.4028235677973366e38)
        raise _must(
            f"contain numbers no larger than 3.4028235e38, but element {index} is {values[index]!r}", True
        ) from None


def sequence(item: CoreSchema) -> CoreSchema:
    """Returns the schema of a tuple of `item`; numpy arrays and other objects with `tolist` are accepted."""
    # One error per sequence is enough; collecting a million errors would take too long.
    items = core_schema.tuple_schema([item], variadic_item_index=0, fail_fast=True)
    python = core_schema.no_info_before_validator_function(_list, items)
    return core_schema.json_or_python_schema(items, python)


def _list(value: Any) -> Any:
    return value.tolist() if hasattr(value, "tolist") else value


def text(name: str) -> CoreSchema:
    """Returns the schema of a string without NUL, which terminates a string in CDR, and without lone surrogates."""
    schema = core_schema.str_schema(strict=True, pattern=r"^[^\x00]*\z")
    # The pattern is an implementation detail, so the JSON schema does not contain it.
    schema["metadata"] = {"pydantic_js_functions": [lambda _schema, _handler: {"type": "string"}]}
    return _with_rule(schema, f"{_article(name)} (text without NUL or lone surrogates)")


def octets(name: str) -> CoreSchema:
    """Returns the schema of `bytes`; JSON contains base64 (as in data URLs) or a list of numbers."""
    integer = {"type": "integer", "minimum": 0, "maximum": 255}
    shown = {"anyOf": [{"type": "string", "contentEncoding": "base64"}, {"type": "array", "items": integer}]}

    def read(value: Any, info: core_schema.ValidationInfo) -> bytes:
        return value if isinstance(value, bytes) else _octets(value, name, info.mode == "json")

    return core_schema.with_info_plain_validator_function(
        read,
        serialization=core_schema.plain_serializer_function_ser_schema(_base64, when_used="json"),
        metadata={"pydantic_js_functions": [lambda _schema, _handler: shown]},
    )


def _octets(value: Any, name: str, from_json: bool) -> bytes:
    if isinstance(value, bytearray | memoryview):
        return bytes(value)
    if (octets := _unsigned_octets(value)) is not None:
        return octets
    if isinstance(value, str) and from_json:
        standard = value.replace("-", "+").replace("_", "/")
        with suppress(ValueError):
            return base64.b64decode(standard + "=" * (-len(standard) % 4), validate=True)
    values = value.tolist() if hasattr(value, "tolist") else value
    if not isinstance(values, list | tuple):
        form = "base64 text" if from_json else "bytes"
        raise _must(f"be {form} or a list of {name} values (integers from 0 to 255)")
    for index, octet in enumerate(values):
        if type(octet) is not int or not 0 <= octet <= 255:
            raise _must(f"contain integers from 0 to 255, but element {index} is {reprlib.repr(octet)}", True)
    return bytes(values)


def _unsigned_octets(value: Any) -> bytes | None:
    # An image as a numpy array has a million elements, so they are not checked one by one.
    try:
        view = memoryview(value)
    except TypeError:
        return None
    return view.tobytes() if view.format == "B" and view.ndim == 1 else None


def _base64(value: bytes) -> str:
    return binascii.b2a_base64(value, newline=False).decode()


def bounded(schema: CoreSchema, low: int, high: int) -> CoreSchema:
    """Returns the schema with the number of elements (for strings: UTF-8 bytes) limited to `low` … `high`."""
    count = f"exactly {high}" if low == high else f"at most {high}"

    def check(value: Any) -> Any:
        size = len(value.encode()) if isinstance(value, str) else len(value)
        if not low <= size <= high:
            unit = "bytes of UTF-8" if isinstance(value, str) else "elements"
            raise _must(f"have {count} {unit}, not {size}", True)
        return value

    def show(inner: CoreSchema, handler: Callable[[CoreSchema], dict[str, Any]]) -> dict[str, Any]:
        shown = handler(inner)
        if shown.get("type") == "array":
            shown |= {"maxItems": high} | ({"minItems": low} if low else {})
        elif shown.get("type") == "string":
            shown |= {"maxLength": high}
        return shown

    return core_schema.no_info_after_validator_function(check, schema, metadata={"pydantic_js_functions": [show]})
