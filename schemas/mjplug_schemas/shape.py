"""The ROS types of a message's fields, read from the pydantic model."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import PydanticUndefined

from mjplug_schemas.errors import DefinitionError
from mjplug_schemas.idl import STRING, AtMost, Exactly, Primitive, Sequence

Kind = Literal["one", "array", "sequence"]


@dataclass(frozen=True, slots=True)
class Field:
    """One field of a message.

    Attributes:
        name: Its name.
        element: Type of the field or of its elements.
        kind: Whether it is a single element, an array or a sequence.
        count: Length of an array, or bound of a sequence (0: unbounded), otherwise 0.
        text_bound: Bound of a string [bytes]; 0: unbounded.
        octets: Whether the Python value is `bytes`.
    """

    name: str
    element: Primitive | type[BaseModel]
    kind: Kind
    count: int
    text_bound: int
    octets: bool


@cache
def fields(message: type[BaseModel]) -> tuple[Field, ...]:
    """Returns the fields of a message type, in the order of definition.

    Raises:
        DefinitionError: The annotation of a field has no ROS type.
    """
    return tuple(_field(message, name, info.annotation, info.metadata) for name, info in message.model_fields.items())


def check(message: type[BaseModel]) -> None:
    """Checks a message class when it is defined: the annotations must have ROS types, and the defaults must be valid.

    Raises:
        DefinitionError: A field is invalid; the text names it.
    """
    for field in fields(message):
        default = message.model_fields[field.name].get_default(call_default_factory=True)
        if default is PydanticUndefined:
            raise DefinitionError(
                f"{message.__name__}.{field.name} needs a default value, because every ROS field has one"
            )
        try:
            validated = getattr(message.model_validate({field.name: default}), field.name)
        except ValidationError as error:
            raise DefinitionError(
                f"{message.__name__}.{field.name} has the default {default!r}, but it {error.errors()[0]['msg']}"
            ) from None
        if type(validated) is not type(default) or validated != default:
            raise DefinitionError(f"{message.__name__}.{field.name} has the default {default!r}; write {validated!r}")


def nested(message: type[BaseModel]) -> Iterator[type[BaseModel]]:
    """Yields the message types of a message's fields, each as often as it is used."""
    for field in fields(message):
        if not isinstance(field.element, Primitive):
            yield field.element


def _field(message: type[BaseModel], name: str, annotation: Any, metadata: list[Any]) -> Field:
    mark = next((mark for mark in metadata if isinstance(mark, Sequence)), None)
    if mark is None:
        return Field(name, *_element(message, name, annotation, metadata, ("one", 0)))
    exact = next((bound.count for bound in metadata if isinstance(bound, Exactly)), 0)
    most = next((bound.count for bound in metadata if isinstance(bound, AtMost)), 0)
    kind: tuple[Kind, int] = ("array", exact) if exact else ("sequence", most)
    if mark.element is not None:
        return Field(name, mark.element, *kind, 0, True)
    item = get_args(annotation)[0]
    marks = list(getattr(item, "__metadata__", ()))
    return Field(name, *_element(message, name, get_args(item)[0] if marks else item, marks, kind))


def _element(
    message: type[BaseModel], name: str, annotation: Any, metadata: list[Any], kind: tuple[Kind, int]
) -> tuple[Primitive | type[BaseModel], Kind, int, int, bool]:
    if primitive := next((mark for mark in metadata if isinstance(mark, Primitive)), None):
        bound = next((mark.count for mark in metadata if isinstance(mark, AtMost)), 0)
        if bound and primitive is not STRING:
            raise DefinitionError(f"{message.__name__}.{name}: only strings and sequences can have a bound")
        return primitive, *kind, bound, False
    if get_origin(annotation) is None and isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation, *kind, 0, False
    raise DefinitionError(
        f"{message.__name__}.{name} has the annotation {annotation}, which has no ROS type; "
        "use types of mjplug_schemas.idl, other messages, or sequences of them"
    )
