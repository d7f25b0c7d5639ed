"""Type hashes (RIHS01, REP-2016), by which ROS nodes check that both sides use the same type definition."""

import hashlib
import json
from collections.abc import Iterable, Iterator
from functools import cache
from itertools import chain
from typing import Any

from pydantic import BaseModel

from mjplug_schemas.action import Action
from mjplug_schemas.idl import Primitive
from mjplug_schemas.message import Message, Service
from mjplug_schemas.service_msgs import ServiceEventInfo
from mjplug_schemas.shape import Field, fields, nested

_NESTED = 1
# Offsets that are added to a type id for bounded strings, arrays and sequences.
_BOUNDED_TEXT = 4
_ARRAY, _BOUNDED_SEQUENCE, _SEQUENCE = 48, 96, 144


@cache
def type_hash(interface: type[Message] | type[Service] | type[Action]) -> str:
    """Returns the type hash of a message, service or action, `RIHS01_` and 64 hexadecimal digits."""
    text = json.dumps(type_description(interface))
    return f"RIHS01_{hashlib.sha256(text.encode()).hexdigest()}"


def type_description(interface: type[Message] | type[Service] | type[Action]) -> dict[str, Any]:
    """Returns the type description that is hashed: the type and all types that it refers to.

    It does not contain default values and constants.
    """
    if issubclass(interface, Service):
        own, parts = _service(interface)
        messages = _service_messages(interface)
    elif issubclass(interface, Action):
        own, parts = _action(interface)
        messages = _action_messages(interface)
    else:
        own, parts = _message(interface), {}
        messages = [interface]
    for used in _closure(messages):
        parts[_name(used)] = _message(used)
    parts.pop(own["type_name"], None)
    return {"type_description": own, "referenced_type_descriptions": [parts[name] for name in sorted(parts)]}


def _closure(messages: Iterable[type[BaseModel]]) -> Iterator[type[BaseModel]]:
    for message in messages:
        yield message
        yield from _closure(nested(message))


def _service_messages(service: type[Service]) -> list[type[BaseModel]]:
    return [service.Request, service.Response, ServiceEventInfo]


def _service(service: type[Service]) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    request, response, event = (f"{service.TYPE}_{part}" for part in ("Request", "Response", "Event"))
    own = _type(
        service.TYPE,
        [
            _field("request_message", _NESTED, nested=request),
            _field("response_message", _NESTED, nested=response),
            _field("event_message", _NESTED, nested=event),
        ],
    )
    event_type = _type(
        event,
        [
            _field("info", _NESTED, nested=ServiceEventInfo.TYPE),
            _field("request", _BOUNDED_SEQUENCE + _NESTED, capacity=1, nested=request),
            _field("response", _BOUNDED_SEQUENCE + _NESTED, capacity=1, nested=response),
        ],
    )
    return own, {event: event_type}


def _action_messages(action: type[Action]) -> list[type[BaseModel]]:
    services = (_service_messages(service) for service in (action.SendGoal, action.GetResult))
    return [action.Goal, action.Result, action.Feedback, action.FeedbackMessage, *chain.from_iterable(services)]


def _action(action: type[Action]) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    parts: dict[str, dict[str, Any]] = {}
    for service in (action.SendGoal, action.GetResult):
        own, event = _service(service)
        parts |= event | {service.TYPE: own}
    members: dict[str, type[Message] | type[Service]] = {
        "goal": action.Goal,
        "result": action.Result,
        "feedback": action.Feedback,
        "send_goal_service": action.SendGoal,
        "get_result_service": action.GetResult,
        "feedback_message": action.FeedbackMessage,
    }
    described = [_field(name, _NESTED, nested=member.TYPE) for name, member in members.items()]
    return _type(action.TYPE, described), parts


def _message(message: type[BaseModel]) -> dict[str, Any]:
    described = [_described(field) for field in fields(message)]
    # ROS adds this field to a message without fields, because some languages have no empty structures.
    return _type(_name(message), described or [_field("structure_needs_at_least_one_member", 3)])


def _described(field: Field) -> dict[str, Any]:
    if isinstance(field.element, Primitive):
        number, nested = field.element.hash_id + (_BOUNDED_TEXT if field.text_bound else 0), ""
    else:
        number, nested = _NESTED, _name(field.element)
    if field.kind == "array":
        number += _ARRAY
    elif field.kind == "sequence":
        number += _BOUNDED_SEQUENCE if field.count else _SEQUENCE
    return _field(field.name, number, field.count, field.text_bound, nested)


def _type(name: str, described: list[dict[str, Any]]) -> dict[str, Any]:
    return {"type_name": name, "fields": described}


def _field(name: str, number: int, capacity: int = 0, text_bound: int = 0, nested: str = "") -> dict[str, Any]:
    type_ = {"type_id": number, "capacity": capacity, "string_capacity": text_bound, "nested_type_name": nested}
    return {"name": name, "type": type_}


def _name(message: type[BaseModel]) -> str:
    return str(getattr(message, "TYPE", message.__name__))
