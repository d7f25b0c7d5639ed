"""Writes the definition of an interface in the format of ROS's `.msg`, `.srv` and `.action` files."""

import json
from collections.abc import Iterator
from inspect import cleandoc
from typing import Any, ClassVar, get_args, get_origin, get_type_hints

from mjplug_schemas.action import Action
from mjplug_schemas.errors import DefinitionError
from mjplug_schemas.idl import Primitive
from mjplug_schemas.message import Message, Service
from mjplug_schemas.shape import Field, fields


def definition(interface: type[Message] | type[Service] | type[Action]) -> str:
    """Returns the definition of a message, service or action, with constants, default values and descriptions."""
    if issubclass(interface, Service):
        request, response = (_body(part) for part in (interface.Request, interface.Response))
        return f"{_heading(interface)}{request}---\n{response}"
    if issubclass(interface, Action):
        goal, result, feedback = (_body(part) for part in (interface.Goal, interface.Result, interface.Feedback))
        return f"{_heading(interface)}{goal}---\n{result}---\n{feedback}"
    return _heading(interface) + _body(interface)


def constants(message: type[Message]) -> Iterator[tuple[str, Primitive, Any]]:
    """Yields name, type and value of each constant of a message, in the order of definition."""
    for name, annotation in get_type_hints(message, include_extras=True).items():
        if get_origin(annotation) is not ClassVar or name not in vars(message):
            continue
        for mark in getattr(get_args(annotation)[0], "__metadata__", ()):
            if isinstance(mark, Primitive):
                yield name, mark, vars(message)[name]


def _body(message: type[Message]) -> str:
    lines = [f"{primitive.name} {name}={_literal(value)}\n" for name, primitive, value in constants(message)]
    if lines:
        lines.append("\n")
    for field in fields(message):
        info = message.model_fields[field.name]
        lines.append(_comment(info.description))
        lines.append(f"{_type(field)} {field.name}{_default(field, info.get_default(call_default_factory=True))}\n")
    return "".join(lines)


def _type(field: Field) -> str:
    if isinstance(field.element, Primitive):
        text = field.element.name
    else:
        package, _, name = str(getattr(field.element, "TYPE", "")).split("/")
        text = f"{package}/{name}"
    if field.text_bound:
        text += f"<={field.text_bound}"
    if field.kind == "array":
        return f"{text}[{field.count}]"
    if field.kind == "sequence":
        return f"{text}[<={field.count}]" if field.count else f"{text}[]"
    return text


def _default(field: Field, value: Any) -> str:
    """Returns the default value with a leading space; empty if it is ROS's zero value."""
    if not isinstance(field.element, Primitive):
        return ""
    if field.kind == "one":
        return f" {_literal(value)}" if value else ""
    return f" [{', '.join(map(_literal, value))}]" if any(value) else ""


def _literal(value: Any) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return repr(value)
    raise DefinitionError(f"{value!r} cannot be written in a .msg file")


def _heading(interface: type) -> str:
    # With the blank line, ROS's tools assign the comment to the interface, not to its first field.
    return f"{_comment(interface.__doc__)}\n" if interface.__doc__ else ""


def _comment(text: str | None) -> str:
    return "".join(f"# {line}".rstrip() + "\n" for line in cleandoc(text or "").splitlines())
