"""How a response type says that the request failed."""

from collections.abc import Iterator

from pydantic.fields import FieldInfo

from mjplug_schemas.message import Message

_REASONS = ("message", "status_message", "error_message", "reason")
"""The names that ROS services give the text beside `success`."""


def refusal(response: type[Message], reason: str) -> Message | None:
    """Returns a response with `success` false and the reason, or None where the type has no `success`."""
    fields = response.model_fields
    if "success" not in fields or fields["success"].annotation is not bool:
        return None
    text = next((name for name in _REASONS if name in set(_texts(fields))), None)
    return response(**{"success": False, **({text: reason} if text else {})})


def _texts(fields: dict[str, FieldInfo]) -> Iterator[str]:
    return (name for name, field in fields.items() if field.annotation is str)
