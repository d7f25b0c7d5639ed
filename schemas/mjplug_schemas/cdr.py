"""Encodes and decodes messages in CDR (XCDR version 1), byte for byte like Fast-CDR and rosbags.

On first use, a type is compiled into a short plan: a list of operations, one for each string, sequence or contiguous
run of fixed-size fields, including nested ones. Alignment is relative to the end of the 4-byte header and at most 8.
"""

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, TypeVar

from pydantic import BaseModel

from mjplug_schemas import cdr_layout
from mjplug_schemas.cdr_layout import Span
from mjplug_schemas.cdr_operations import Blank, Fault, Number, Operation, Run, Text
from mjplug_schemas.cdr_sequences import Element, Extent, Numbers, Octets, Rest, Structs, Texts
from mjplug_schemas.errors import CodecError
from mjplug_schemas.idl import Primitive
from mjplug_schemas.shape import fields

__all__ = ["Span", "decode", "encode", "encode_with_layout", "unchecked"]

M = TypeVar("M", bound=BaseModel)

_LITTLE_ENDIAN = b"\0\1\0\0"
_BYTE_ORDERS = {b"\0\0": ">", b"\0\1": "<"}
# Frozen models refuse normal assignment, and these setters are faster than object.__setattr__.
_set_dict, _set_fields_set, _set_extra, _set_private = (
    vars(BaseModel)[name].__set__
    for name in ("__dict__", "__pydantic_fields_set__", "__pydantic_extra__", "__pydantic_private__")
)
# Cyclone DDS pads messages with zeros to a multiple of 4. More bytes indicate a message of another type.
_MAX_PADDING = 3


def unchecked(message: type[M], values: dict[str, Any]) -> M:
    """Returns a message with the given values of all its fields, which are not validated."""
    built = message.__new__(message)
    _set_dict(built, values)
    _set_fields_set(built, _all_fields(message))
    _set_extra(built, None)
    _set_private(built, None)
    return built


def encode(message: BaseModel) -> bytes:
    """Returns a message in little-endian CDR, including the 4-byte header.

    Raises:
        CodecError: A value does not fit its ROS type; this cannot happen with a validated message.
    """
    return bytes(_encode(message))


def encode_with_layout(message: BaseModel) -> tuple[bytearray, dict[str, Span]]:
    """Returns a message in CDR and the position of each value, so that new values can be written in place.

    Returns:
        The buffer, and the span of each leaf by its path, such as `header.stamp.sec`, `position` (all elements of a
        primitive sequence) or `free_joints[3].pose.pose.position.x`.
    """
    out = _encode(message)
    return out, cdr_layout.spans(type(message), out)


def decode(message: type[M], buffer: bytes | bytearray | memoryview, packed: bool = False) -> M:
    """Returns the message of the given type that is encoded in CDR bytes of either byte order.

    Args:
        message: The message's class.
        buffer: The bytes.
        packed: Whether sequences of numbers become read-only memoryviews of the bytes where the byte order allows it,
            which takes no time per number. Otherwise they are tuples.

    Raises:
        CodecError: The bytes are truncated, too long, or contain an invalid value.
    """
    source = buffer if type(buffer) is bytes else bytes(memoryview(buffer))
    order = _BYTE_ORDERS.get(source[:2])
    if order is None or len(source) < 4:
        raise CodecError(
            f"{_name(message)}: expected a 4-byte CDR header that starts with 00 00 or 00 01, "
            f"got {source[:4].hex(' ') or 'no bytes at all'}"
        )
    values: list[Any] = []
    at = 4
    try:
        for operation in _plan(message, order, packed):
            at = operation.read(source, at, values)
    except Fault as fault:
        raise CodecError(f"{_name(message)}: {fault}") from None
    if len(source) - at > _MAX_PADDING:
        raise CodecError(f"{_name(message)}: the message ends at byte {at}, but {len(source) - at} more bytes follow")
    built: M = _builder(message)(iter(values))
    return built


def _encode(message: BaseModel) -> bytearray:
    out = bytearray(_LITTLE_ENDIAN)
    try:
        for operation in _plan(type(message), "<"):
            operation.write(out, message)
    except Fault as fault:
        raise CodecError(f"{_name(type(message))}: {fault}") from None
    except (TypeError, AttributeError, ValueError) as error:
        raise CodecError(
            f"{_name(type(message))}: a value that was not validated does not fit its type: {error}"
        ) from error
    return out


def _name(message: type[BaseModel]) -> str:
    return str(getattr(message, "TYPE", message.__name__))


@cache
def _plan(message: type[BaseModel], order: str, packed: bool = False) -> tuple[Operation, ...]:
    plan: list[Operation] = []
    run: list[Number] = []

    def end_run() -> None:
        if run:
            plan.append(Run(run, order))
            run.clear()

    for step in _steps(message, order, "", packed):
        if isinstance(step, Number):
            run.append(step)
        else:
            end_run()
            plan.append(step)
    end_run()
    if packed:
        end = next((i for i, step in enumerate(plan, 1) if isinstance(step, Numbers)), len(plan))
        if end < len(plan):
            return (*plan[:end], Rest(tuple(plan[end:])))
    return tuple(plan)


def _steps(message: type[BaseModel], order: str, prefix: str, packed: bool) -> Iterator[Operation | Number]:
    if not fields(message):
        yield Blank(prefix.removesuffix("."))
    for field in fields(message):
        path = prefix + field.name
        extent = Extent(field.count, 0) if field.kind == "array" else Extent(None, field.count)
        if not isinstance(field.element, Primitive):
            if field.kind == "one":
                yield from _steps(field.element, order, path + ".", packed)
            else:
                parts = Element(_plan(field.element, order), _builder(field.element), min_size(field.element))
                yield Structs(path, order, extent, parts)
        elif field.octets:
            yield Octets(path, order, extent)
        elif field.element.size == 0:
            wide = field.element.name == "wstring"
            text = Text(path, order, field.text_bound, wide)
            yield text if field.kind == "one" else Texts(path, order, extent, text)
        elif field.kind == "one":
            yield Number(path, field.element)
        else:
            yield Numbers(path, order, extent, field.element, packed)


@cache
def min_size(message: type[BaseModel]) -> int:
    """Returns the smallest size of a message of this type without padding [bytes], to check a claimed element count."""
    total = 0
    for field in fields(message):
        element = (field.element.size or 4) if isinstance(field.element, Primitive) else min_size(field.element)
        total += 4 if field.kind == "sequence" else element * (field.count or 1)
    return max(total, 1)


@cache
def _all_fields(message: type[BaseModel]) -> set[str]:
    # All instances share this set; it is never changed, because messages are frozen and copies copy it.
    return {field.name for field in fields(message)}


@cache
def _builder(message: type[BaseModel]) -> Callable[[Iterator[Any]], Any]:
    """Returns a function that builds the message from its values in wire order.

    The function skips validation, because the operations return only valid values.
    """
    names = tuple(field.name for field in fields(message))
    inner = {
        field.name: _builder(field.element)
        for field in fields(message)
        if field.kind == "one" and not isinstance(field.element, Primitive)
    }
    parts = [(name, inner.get(name, next)) for name in names]
    fields_set = _all_fields(message)

    def build(values: Iterator[Any]) -> Any:
        built = message.__new__(message)
        _set_dict(
            built, {name: part(values) for name, part in parts} if inner else dict(zip(names, values, strict=False))
        )
        _set_fields_set(built, fields_set)
        _set_extra(built, None)
        _set_private(built, None)
        return built

    return build
