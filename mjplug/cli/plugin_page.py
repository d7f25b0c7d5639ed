"""The output of `mjplug plugin info`: documentation, parameters and an example configuration."""

import math
from collections.abc import Iterator, Mapping
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from mjplug.plugin import Plugin

_WORDS = {bool: "true or false", int: "integer", float: "number", str: "string"}


def page(type: str, plugin: type[Plugin[Any]]) -> Iterator[str]:
    """Yields the lines about a plugin; `type` is the name that the user has given."""
    yield f"{plugin.__name__} ({plugin.__module__})\n"
    yield _dedent(plugin.__doc__ or "")
    parameters = plugin.parameters_type
    lines = list(_described(parameters, "  "))
    yield "\nParameters:" if lines else "\nNo parameters."
    yield from lines
    instance = type.rsplit("/", maxsplit=1)[-1].rsplit(":", maxsplit=1)[-1].lower()
    yield f"\nIn a configuration file:\n\n  plugins:\n    {instance}:\n      type: {type}"
    yield from _written(parameters, "      ")


def _described(parameters: type[BaseModel], indent: str) -> Iterator[str]:
    for name, field in parameters.model_fields.items():
        yield f"{indent}{name} ({_type_name(field.annotation)}, {_default(field)})"
        yield f"{indent}    {field.description or ''}"
        if inner := _parameters_in(field.annotation):
            yield from _described(inner, f"{indent}    ")
    if named := _named_below(parameters):
        yield f"{indent}<name> (any number of them): {_dedent(named.__doc__ or '').partition(chr(10))[0]}"
        yield from _described(named, f"{indent}  ")


def _written(parameters: type[BaseModel], indent: str) -> Iterator[str]:
    """Yields the lines of a configuration file, without parameters whose default is derived."""
    for name, field in parameters.model_fields.items():
        if field.is_required() or field.default is not None:
            yield f"{indent}{name}: {'...' if field.is_required() else _yaml(field.default)}"
    if named := _named_below(parameters):
        yield f"{indent}<name>:"
        yield from _written(named, f"{indent}  ")


def _named_below(parameters: type[BaseModel]) -> type[BaseModel] | None:
    """Returns the class of the parameters below names that the user chooses, if there are any."""
    if parameters.model_config.get("extra") != "allow":
        return None
    below = get_args(get_type_hints(parameters).get("__pydantic_extra__"))
    return below[1] if len(below) == 2 and isinstance(below[1], type) and issubclass(below[1], BaseModel) else None


def _parameters_in(annotation: Any) -> type[BaseModel] | None:
    """Returns the class of the parameters inside a parameter, or of those below names that the user chooses."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(filter(None, map(_parameters_in, get_args(annotation))), None)


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    return "optional" if field.default is None else f"default {_yaml(field.default)}"


def _dedent(text: str) -> str:
    return "\n".join(line.strip() for line in text.strip().splitlines())


def _type_name(annotation: Any) -> str:
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _type_name(arguments[0])
    if origin is Literal:
        return " | ".join(map(str, arguments))
    if origin in (Union, UnionType):
        return " or ".join(_type_name(argument) for argument in arguments if argument is not NoneType)
    if origin in (tuple, list):
        elements = [argument for argument in arguments if argument is not Ellipsis]
        count = f"{len(elements)} times " if origin is tuple and Ellipsis not in arguments else ""
        return f"list of {count}{_type_name(elements[0])}" if len(set(elements)) == 1 else "list"
    if origin is dict:
        return f"mapping of names to {_type_name(arguments[1])}"
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return "section"
    if isinstance(annotation, type):
        return _WORDS.get(annotation, annotation.__name__)
    return str(annotation).replace("typing.", "")


def _yaml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) and not math.isfinite(value):
        return f"{value}".replace("inf", ".inf").replace("nan", ".nan")
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, list | tuple | set | frozenset):
        return f"[{', '.join(map(_yaml, value))}]"
    if isinstance(value, BaseModel):
        value = value.model_dump()
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key}: {_yaml(item)}' for key, item in value.items())}}}"
    return "null" if value is None else str(value)
