"""The service `~/get_type_description` of the server's node."""

from collections.abc import Iterator, Mapping
from typing import Any

from mjplug_schemas.definition import definition
from mjplug_schemas.errors import UnknownType
from mjplug_schemas.registry import Interface, find
from mjplug_schemas.rihs01 import type_description, type_hash
from mjplug_schemas.type_description_interfaces import (
    Field,
    FieldType,
    GetTypeDescription,
    IndividualTypeDescription,
    TypeDescription,
    TypeSource,
)


class TypeDescriptions:
    """Describes the types of the node's topics and services.

    Args:
        types: The types by name; types may be added later.
    """

    def __init__(self, types: Mapping[str, Interface]) -> None:
        self._types = types

    def answer(self, request: GetTypeDescription.Request) -> GetTypeDescription.Response:
        """Returns the description of the type with the requested name and hash."""
        interface: Any = self._types.get(request.type_name)
        if interface is None:
            return _refusal(f"this node has no topic, service or action of type {request.type_name!r}")
        if request.type_hash not in ("", known := type_hash(interface)):
            return _refusal(f"the type hash of {request.type_name} is {known} at this node, not {request.type_hash}")
        described = type_description(interface)
        parts = [described["type_description"], *described["referenced_type_descriptions"]]
        own, *others = (_individual(part) for part in parts)
        sources = tuple(_sources(interface, parts)) if request.include_type_sources else ()
        return GetTypeDescription.Response(
            successful=True,
            type_description=TypeDescription(type_description=own, referenced_type_descriptions=tuple(others)),
            type_sources=sources,
        )


def _individual(described: Mapping[str, Any]) -> IndividualTypeDescription:
    fields = tuple(Field(name=field["name"], type=FieldType(**field["type"])) for field in described["fields"])
    return IndividualTypeDescription(type_name=described["type_name"], fields=fields)


def _sources(interface: Interface, parts: list[Mapping[str, Any]]) -> Iterator[TypeSource]:
    for part in parts:
        name = part["type_name"]
        kind = "" if name.endswith(("_Request", "_Response", "_Event")) else name.split("/")[1]
        try:
            text = definition(interface if name == interface.TYPE else find(name)) if kind else ""
        except UnknownType:
            kind, text = "", ""
        yield TypeSource(type_name=name, encoding=kind or "implicit", raw_file_contents=text)


def _refusal(reason: str) -> GetTypeDescription.Response:
    return GetTypeDescription.Response(successful=False, failure_reason=reason)
