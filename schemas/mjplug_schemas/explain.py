"""The error message for JSON that is not a valid message."""

import json
from typing import Any

from pydantic import BaseModel, ValidationError

from mjplug_schemas.errors import CodecError, did_you_mean
from mjplug_schemas.idl import Primitive
from mjplug_schemas.shape import fields

_MAX_SHOWN = 5
# Collecting the details of more errors takes too long. Only a large number of unknown fields causes so many errors,
# because sequences report their first error only.
_MAX_COLLECTED = 1000
_RULES = {
    "tuple_type": "must be a list",
    "model_type": "must be an object",
    "model_attributes_type": "must be an object",
}


def json_error(message: type[BaseModel], error: ValidationError) -> CodecError:
    """Returns the error for JSON that pydantic refused, with the first few problems and a limited length."""
    count = error.error_count()
    if count > _MAX_COLLECTED:
        text = f"{count} errors, most of them unknown fields{_known(message)}"
    else:
        problems = error.errors(include_url=False)
        text = "; ".join(_problem(message, problem) for problem in problems[:_MAX_SHOWN])
        text += f"; and {count - _MAX_SHOWN} more errors" if count > _MAX_SHOWN else ""
    return CodecError(f"{getattr(message, 'TYPE', message.__name__)}: {text}")


def _problem(message: type[BaseModel], problem: Any) -> str:
    path, value, kind = problem["loc"], problem["input"], problem["type"]
    if kind == "extra_forbidden":
        return _unknown_field(message, path)
    if kind == "json_invalid":
        return f"not valid JSON: {problem['ctx']['error']}" if value else "not valid JSON: the text is empty"
    where = _cut(_join(path), 200) or "the message"
    rule = _RULES.get(kind, problem["msg"])
    return f"{where} {rule}" if kind == "ros_part" else f"{where} {rule}, got {_shown(value)}"


def _unknown_field(message: type[BaseModel], path: tuple[int | str, ...]) -> str:
    owner = message
    for step in path[:-1]:
        if isinstance(step, str):
            element = next(field.element for field in fields(owner) if field.name == step)
            owner = element if not isinstance(element, Primitive) else owner
    suggestion = did_you_mean(str(path[-1]), [field.name for field in fields(owner)])
    return f"unknown field {_cut(_join(path), 200)!r}{suggestion}{_known(owner)}"


def _known(message: type[BaseModel]) -> str:
    names = [field.name for field in fields(message)]
    return f"; known: {', '.join(names)}" if names else "; the type has no fields"


def _join(path: tuple[int | str, ...]) -> str:
    text = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)
    return text.removeprefix(".")


def _cut(text: str, max_length: int) -> str:
    return text if len(text) <= max_length else f"{text[: max_length - 1]}…"


def _shown(value: Any) -> str:
    """Returns a value as JSON text; long texts are cut, and containers are described by their size."""
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if isinstance(value, str):
        return json.dumps(_cut(value, 60), ensure_ascii=False)
    return _cut(json.dumps(value, default=repr), 60)
