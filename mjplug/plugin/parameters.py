"""The base class of a plugin's parameters, and annotations for their fields."""

from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ConfigDict, GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticKnownError, core_schema


class Parameters(BaseModel):
    """Base class of a plugin's parameters: frozen, with strict types; unknown names are refused.

    Give every field a description with its unit; `mjplug plugin info` shows it.
    """

    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, use_attribute_docstrings=True, allow_inf_nan=False
    )


@dataclass(frozen=True, slots=True)
class _Nested:
    """See `NestedParameters`."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(_nested, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {"anyOf": [handler(schema), {"type": "null"}]}


@dataclass(frozen=True, slots=True)
class _OneOrMore:
    """See `OneOrMore`."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(_listed, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        listed = handler(schema)
        one = listed["items"]
        if one.get("type") == "string" and "enum" not in one:
            one = {"minLength": 1, **one}
        return {"anyOf": [one, listed]}


NestedParameters = _Nested()
"""Marks sections whose names the user chooses: `__pydantic_extra__: dict[str, Annotated[Lidar, NestedParameters]]`.

A plain value in place of a section is refused as an unknown parameter; an empty section gets the defaults.
"""

OneOrMore = _OneOrMore()
"""Marks a list that may also be written as a single value: `bodies: Annotated[tuple[str, ...], OneOrMore]`."""


def _nested(value: object) -> object:
    if isinstance(value, bool | int | float | str):
        raise PydanticKnownError("extra_forbidden")
    return {} if value is None else value


def _listed(value: object) -> object:
    if isinstance(value, list):
        return tuple(value)
    # Empty text is refused, because it is neither a name nor an empty list.
    return (value,) if isinstance(value, int | float | str) and not isinstance(value, bool) and value != "" else value
