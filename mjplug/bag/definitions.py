"""Definitions of types in bags: the text of a type with those of its fields, and message classes made from such text.

A bag may contain types that this installation does not know, such as those of other packages or of a robot's ROS.
"""

import re
from collections.abc import Mapping
from functools import lru_cache
from typing import Annotated, Any

from pydantic import create_model

from mjplug.bag.errors import BagError
from mjplug_schemas import idl, registry
from mjplug_schemas.definition import definition
from mjplug_schemas.errors import UnknownType
from mjplug_schemas.message import Message
from mjplug_schemas.rihs01 import type_hash
from mjplug_schemas.shape import nested

_SEPARATOR = "=" * 80
_FIELD = re.compile(
    r"(?P<base>[A-Za-z][\w/]*)(?:<=(?P<text>\d+))?(?P<many>\[(?P<bound><=)?(?P<count>\d*)\])?\s+(?P<name>[A-Za-z]\w*)"
)
_CONSTANT = re.compile(r"\S+\s+[A-Za-z]\w*\s*=")

_PRIMITIVES: dict[str, Any] = {
    "bool": idl.boolean,
    **{name: getattr(idl, name) for name in ("byte", "char", "string", "wstring", "float32", "float64")},
    **{name: getattr(idl, name) for bits in (8, 16, 32, 64) for name in (f"int{bits}", f"uint{bits}")},
}
_OCTETS = {"byte": idl.byte_sequence, "char": idl.char_sequence, "uint8": idl.uint8_sequence}
_ZEROS: dict[str, Any] = {"bool": False, "string": "", "wstring": "", "float32": 0.0, "float64": 0.0}


def text_of(type: str, definitions: Mapping[str, str]) -> str:
    """Returns the definition of a type followed by those of the types of its fields, as bags contain it (`ros2msg`).

    Args:
        type: Name of the type, such as `sensor_msgs/msg/Imu`.
        definitions: The text of each type by name, at least of those that are needed.

    Raises:
        BagError: One is missing.
    """
    found: dict[str, str] = {}
    pending = [type]
    while pending:
        name = pending.pop(0)
        if name in found:
            continue
        if name not in definitions:
            raise BagError(f"the definition of {name} is missing, which {type} needs")
        found[name] = definitions[name]
        pending += [_full(field["base"], name) for field in _fields(found[name]) if field["base"] not in _PRIMITIVES]
    root, *others = found
    return found[root] + "".join(f"{_SEPARATOR}\nMSG: {name.replace('/msg/', '/')}\n{found[name]}" for name in others)


def text_of_class(message: type[Message]) -> str:
    """Returns the definition of a message class, as bags contain it."""
    definitions: dict[str, str] = {}
    pending: list[Any] = [message]
    while pending:
        found = pending.pop()
        if found.TYPE not in definitions:
            definitions[found.TYPE] = definition(found)
            pending += nested(found)
    return text_of(message.TYPE, definitions)


@lru_cache(maxsize=1024)
def class_of(type: str, text: str) -> Any:
    """Returns the message class of a type in a bag: the one of `mjplug_schemas` if its definition is the same.

    Args:
        type: Name of the type.
        text: Its definition, with those of the types of its fields.

    Raises:
        BagError: The definition cannot be read.
    """
    parts = re.split(rf"^{_SEPARATOR}\s*$", text, flags=re.MULTILINE)
    definitions = {type: parts[0]}
    for part in parts[1:]:
        head, _, body = part.lstrip("\n").partition("\n")
        definitions[_full(head.removeprefix("MSG:").strip(), type)] = body
    made = _make(type, definitions, {}, ())
    try:
        known: Any = registry.find(type)
    except UnknownType:
        return made
    return known if type_hash(known) == type_hash(made) else made


def _make(name: str, definitions: Mapping[str, str], made: dict[str, Any], above: tuple[str, ...]) -> Any:
    if name in made:
        return made[name]
    if name not in definitions or name in above:
        raise BagError(f"the definition of {quoted(name)} is {'recursive' if name in above else 'missing'}")
    members: dict[str, Any] = {}
    for field in _fields(definitions[name]):
        base, many, count = field["base"], field["many"] is not None, int(field["count"] or 0)
        if base in _PRIMITIVES:
            element, zero = _PRIMITIVES[base], _ZEROS.get(base, 0)
            if field["text"]:
                element = Annotated[element, idl.AtMost(int(field["text"]))]
        else:
            element = _make(_full(base, name), definitions, made, (*above, name))
            zero = element()
        exact = many and count > 0 and not field["bound"]
        if many:
            octets = _OCTETS.get(base)
            default = (bytes(count) if octets else (zero,) * count) if exact else (b"" if octets else ())
            annotation: Any = octets or idl.sequence[element]  # type: ignore[valid-type]
            if count:
                annotation = Annotated[annotation, idl.Exactly(count) if exact else idl.AtMost(count)]
            members[field["name"]] = (annotation, default)
        else:
            members[field["name"]] = (element, zero)
    package, _, short = name.partition("/msg/")
    try:
        # mypy does not know that keyword arguments of the class are possible.
        made[name] = create_model(short, __base__=Message, __cls_kwargs__={"package": package}, **members)
    except Exception as error:
        # pydantic raises errors of several kinds for names that it reserves.
        raise BagError(f"the definition of {quoted(name)} cannot be used: {error}") from error
    return made[name]


def quoted(name: str) -> str:
    """Returns a name from a file in quotes, without control characters."""
    return ascii(name[:100])


def _fields(text: str) -> list[re.Match[str]]:
    """Returns the fields in a definition; constants, comments and default values are skipped."""
    found = []
    for line in text.splitlines():
        code = line.partition("#")[0].strip() if not line.lstrip().startswith("#") else ""
        if not code or _CONSTANT.match(code):
            continue
        match = _FIELD.match(code)
        if match is None:
            raise BagError(f"{quoted(code)} is not a field of a message")
        found.append(match)
    return found


def _full(name: str, inside: str) -> str:
    """Returns the full name of a type that a definition refers to."""
    parts = name.split("/")
    if len(parts) == 1:
        return "std_msgs/msg/Header" if name == "Header" else f"{inside.partition('/')[0]}/msg/{name}"
    return f"{parts[0]}/msg/{parts[-1]}"
