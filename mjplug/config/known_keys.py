"""The known keys of a pydantic model at a location, for error messages."""

from collections.abc import Iterator, Sequence
from types import UnionType
from typing import Annotated, Any, TypeGuard, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo


def known_keys(model: type[BaseModel], location: Sequence[str | int]) -> list[str]:
    """Returns the known keys at the location of a validation error.

    Args:
        model: The model of the validation.
        location: pydantic's `loc` of the mapping; names of union members in it are skipped.
    """
    annotations: list[Any] = [model]
    for part in location:
        below = [inner for annotation in annotations for inner in _below(annotation, part)]
        annotations = below or annotations
    return [key for annotation in annotations for kind in _members(annotation) for key in _keys(kind)]


def _below(annotation: Any, part: str | int) -> Iterator[Any]:
    for kind in _members(annotation):
        if _is_model(kind):
            for name, field in kind.model_fields.items():
                if part in (name, _alias(field)):
                    yield field.annotation
            extra = kind.__annotations__.get("__pydantic_extra__")
            if part not in _keys(kind):
                yield from _below(extra, part)
        elif get_origin(kind) is dict and isinstance(part, str):
            yield get_args(kind)[1]
        elif get_origin(kind) in (list, tuple) and isinstance(part, int):
            yield get_args(kind)[0]


def _members(annotation: Any) -> Iterator[Any]:
    """Yields the types that an annotation allows, without `Annotated` and unions."""
    if get_origin(annotation) is Annotated:
        yield from _members(get_args(annotation)[0])
    elif get_origin(annotation) in (Union, UnionType):
        for member in get_args(annotation):
            yield from _members(member)
    else:
        yield annotation


def _keys(kind: Any) -> list[str]:
    return [_alias(field) or name for name, field in kind.model_fields.items()] if _is_model(kind) else []


def _alias(field: FieldInfo) -> str | None:
    alias = field.validation_alias or field.alias
    return alias if isinstance(alias, str) else None


def _is_model(kind: Any) -> TypeGuard[type[BaseModel]]:
    return isinstance(kind, type) and issubclass(kind, BaseModel)
