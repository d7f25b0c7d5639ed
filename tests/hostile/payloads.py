"""Trees of values as bytes: CDR and JSON, right in form, and then spoilt.

The CDR writer is independent of the server's: it also writes what that one refuses to write, such as NUL in a string.
"""

import base64
import json
import math
import struct

from hostile.values import default_of

from mjplug_schemas.idl import Primitive
from mjplug_schemas.shape import fields

_HEADERS = {"<": b"\0\1\0\0", ">": b"\0\0\0\0"}
_HUGE = (0xFFFFFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFE, 0x10000, 0x01000000)
_MOST_BYTES = 1 << 21


def cdr(message_type, tree, order="<"):
    """Returns a tree of values encoded in CDR, without validation."""
    out = bytearray(_HEADERS[order])
    _write(out, message_type, tree, order)
    return bytes(out)


def _write(out, message_type, tree, order):
    if not fields(message_type):
        out.append(0)
    for field in fields(message_type):
        value = tree.get(field.name, getattr(default_of(message_type), field.name))
        if field.octets:
            if field.kind == "sequence":
                _number(out, len(value), "I", 4, order)
            out += value
        elif field.kind == "one":
            _write_one(out, field.element, value, order)
        else:
            if field.kind == "sequence":
                _number(out, len(value), "I", 4, order)
            for item in value:
                _write_one(out, field.element, item, order)


def _write_one(out, element, value, order):
    if not isinstance(element, Primitive):
        _write(out, element, value if isinstance(value, dict) else value.model_dump(), order)
    elif element.name == "string":
        raw = value.encode("utf-8", "surrogatepass")
        _number(out, len(raw) + 1, "I", 4, order)
        out += raw + b"\0"
    elif element.name == "wstring":
        raw = value.encode("utf-16-le" if order == "<" else "utf-16-be", "surrogatepass")
        _number(out, len(raw) // 2, "I", 4, order)
        out += raw
    else:
        if element.name == "float32" and abs(value) > 3.4e38 and value - value == 0:
            value = 3.4e38
        _number(out, value, element.code, element.size, order)


def _number(out, value, code, size, order):
    out += bytes(-(len(out) - 4) % size)
    out += struct.pack(order + code, value)


def as_json(tree, quoted_floats=True):
    """Returns a tree of values as JSON text; NaN and infinity as Python writes them or as quoted text."""

    def plain(value):
        if isinstance(value, dict):
            return {name: plain(item) for name, item in value.items()}
        if isinstance(value, list | tuple):
            return [plain(item) for item in value]
        if isinstance(value, bytes):
            return base64.b64encode(value).decode()
        if quoted_floats and isinstance(value, float) and not math.isfinite(value):
            return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
        return value

    return json.dumps(plain(tree)).encode()


def spoilt(raw, random):
    """Returns bytes with a few mutations: cut, lengthened, flipped, spliced, with huge lengths or another header."""
    out = bytearray(raw)
    for _ in range(random.choice((1, 1, 1, 2, 3, 8))):
        _spoil(out, random)
    return bytes(out[:_MOST_BYTES])


def _spoil(out, random):
    kind = random.randrange(10)
    at = random.randrange(len(out) + 1)
    if kind == 0:
        del out[at:]
    elif kind == 1:
        out += random.randbytes(random.choice((1, 2, 3, 4, 5, 64, 5000)))
    elif kind == 2 and out:
        out[at % len(out)] ^= 1 << random.randrange(8)
    elif kind == 3 and out:
        out[at % len(out)] = random.choice((0, 1, 0x7F, 0x80, 0xFF, random.randrange(256)))
    elif kind == 4 and len(out) >= 8:
        # Lengths stand at multiples of 4.
        at = 4 + random.randrange((len(out) - 4) // 4) * 4
        struct.pack_into(random.choice("<>") + "I", out, at, random.choice(_HUGE))
    elif kind == 5:
        piece = bytes(out[at : at + random.choice((1, 4, 8, 100))])
        where = random.randrange(len(out) + 1)
        out[where:where] = piece * random.choice((1, 2, 50))
    elif kind == 6:
        out[:4] = random.choice((b"\0\0\0\0", b"\0\1\0\0", b"\0\3\0\0", b"\0\2\0\0", b"\0\1\0\3", b"\xff\xff\xff\xff"))
    elif kind == 7:
        out[at : at + 4] = random.choice(
            (b"{", b"}", b"[", b"]", b'"', b"null", b"1e999", b"\\u0000", b"\\ud800", b",")
        )
    elif kind == 8:
        out[at : at + random.randrange(16)] = b""
    elif out:
        for _ in range(4):
            out[random.randrange(len(out))] = random.randrange(256)


def odd_json(tree, random):
    """Returns JSON with a wrong thing at one place: another type, an unknown, a missing or a doubled field."""
    text = as_json(tree, random.random() < 0.5).decode()
    kind = random.randrange(6)
    if kind == 0:
        wrong = random.choice(("null", '"text"', "1.5", "-1", str(2**70), "true", "{}", "[[]]", "1e400", "-0", '"NaN"'))
        places = [i for i, character in enumerate(text) if character == ":"]
        if places:
            at = random.choice(places)
            end = min((i for i in (text.find(",", at), text.find("}", at)) if i > 0), default=len(text))
            text = f"{text[:at]}: {wrong}{text[end:]}"
    elif kind == 1:
        text = text.replace("{", '{"unknown": 1, ', 1)
    elif kind == 2:
        text = text.replace("{", '{"paused": true, "paused": false, ', 1)
    elif kind == 3:
        depth = random.choice((10, 200, 2000, 30_000))
        text = '{"a":' * depth + "1" + "}" * random.choice((0, depth))
    elif kind == 4:
        text = " " * random.choice((1, 1000)) + text + random.choice(("", "\n", "{}", "]", "\0"))
    else:
        numbers = ",".join(["0"] * random.choice((100, 20_000)))
        text = text.replace("[", f"[{numbers},", 1)
    return text.encode("utf-8", "surrogatepass")
