"""XCDR version 1, little endian, as every RMW writes the types of ROS."""

import struct

from rclpy._interfaces import NUMBERS


class Error(RuntimeError):
    """The error of a middleware for bytes that it cannot decode."""


def serialize(message):
    out = bytearray()
    _write(out, message)
    return b"\0\1\0\0" + bytes(out)


def deserialize(payload, message_type):
    if payload[:2] != b"\0\1":
        raise Error("failed to deserialize ROS message")
    try:
        message, _ = _read(memoryview(payload)[4:], 0, message_type)
    except (struct.error, ValueError, UnicodeDecodeError, IndexError):
        raise Error("failed to deserialize ROS message") from None
    return message


def _write(out, message):
    if not message.FIELDS:
        out.append(0)
    for field in message.FIELDS:
        value = getattr(message, field.name)
        if field.count is None:
            value = [value]
        elif field.count == -1:
            _number(out, "I", len(value))
        for element in value:
            if field.base == "string":
                text = element.encode() + b"\0"
                _number(out, "I", len(text))
                out += text
            elif isinstance(field.base, str):
                _number(out, NUMBERS[field.base][0], element)
            else:
                _write(out, element)


def _number(out, code, value):
    out += bytes(-len(out) % struct.calcsize(code))
    out += struct.pack(f"<{code}", value)


def _read(source, at, message_type):
    message = message_type()
    if not message.FIELDS:
        at += 1
    for field in message.FIELDS:
        count = 1 if field.count is None else field.count
        if count == -1:
            count, at = _take(source, at, "I")
            if count > len(source):
                raise ValueError(count)
        values = []
        for _ in range(count):
            if field.base == "string":
                size, at = _take(source, at, "I")
                values.append(bytes(source[at : at + size - 1]).decode())
                at += size
            elif isinstance(field.base, str):
                value, at = _take(source, at, NUMBERS[field.base][0])
                values.append(value)
            else:
                value, at = _read(source, at, field.base)
                values.append(value)
        setattr(message, field.name, values[0] if field.count is None else values)
    return message, at


def _take(source, at, code):
    at += -at % struct.calcsize(code)
    return struct.unpack_from(f"<{code}", source, at)[0], at + struct.calcsize(code)
