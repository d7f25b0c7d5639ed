"""Responses that report a failed request."""

from collections.abc import Iterator

from pydantic.fields import FieldInfo

from mjplug_schemas.message import Message

_REASONS = ("message", "status_message", "error_message", "reason")
"""Names of the text field beside `success` in ROS services, most common first."""


def refusal(response: type[Message], reason: str) -> Message | None:
    """Returns a response with `success` false and the reason; None if the type has no field `success`."""
    fields = response.model_fields
    if "success" not in fields or fields["success"].annotation is not bool:
        return None
    text = next((name for name in _REASONS if name in set(_texts(fields))), None)
    return response(**{"success": False, **({text: reason} if text else {})})


def _texts(fields: dict[str, FieldInfo]) -> Iterator[str]:
    return (name for name, field in fields.items() if field.annotation is str)
