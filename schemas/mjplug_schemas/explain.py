"""The sentence for JSON that is not the message it should be."""

import json
from typing import Any

from pydantic import BaseModel, ValidationError

from mjplug_schemas.errors import CodecError, did_you_mean
from mjplug_schemas.idl import Primitive
from mjplug_schemas.shape import fields

_MOST_SHOWN = 5
# Collecting the details of more errors than this takes longer than anybody would read; only a flood of unknown fields
# makes so many, since sequences report their first error only.
_MOST_COLLECTED = 1000
_RULES = {
    "tuple_type": "must be a list",
    "model_type": "must be an object",
    "model_attributes_type": "must be an object",
}


def json_error(message: type[BaseModel], error: ValidationError) -> CodecError:
    """Returns the error to raise for JSON that pydantic refused: the first few problems, in a bounded length."""
    count = error.error_count()
    if count > _MOST_COLLECTED:
        text = f"{count} errors, most of them unknown fields{_known(message)}"
    else:
        problems = error.errors(include_url=False)
        text = "; ".join(_problem(message, problem) for problem in problems[:_MOST_SHOWN])
        text += f"; and {count - _MOST_SHOWN} more errors" if count > _MOST_SHOWN else ""
    return CodecError(f"{getattr(message, 'TYPE', message.__name__)}: {text}")


def _problem(message: type[BaseModel], problem: Any) -> str:
    path, value, kind = problem["loc"], problem["input"], problem["type"]
    if kind == "extra_forbidden":
        return _unknown_field(message, path)
    if kind == "json_invalid":
        return f"not valid JSON: {problem['ctx']['error']}" if value else "not valid JSON: there is nothing"
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
    return f"; known: {', '.join(names)}" if names else "; there are no fields"


def _join(path: tuple[int | str, ...]) -> str:
    text = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)
    return text.removeprefix(".")


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most - 1]}…"


def _shown(value: Any) -> str:
    """Returns a value as JSON writes it, long ones cut, containers by their size."""
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if isinstance(value, str):
        return json.dumps(_cut(value, 60), ensure_ascii=False)
    return _cut(json.dumps(value, default=repr), 60)
