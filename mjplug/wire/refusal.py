"""Responses that report a failed request: with `success` false, or with the result of simulation_interfaces."""

from collections.abc import Iterator

from pydantic.fields import FieldInfo

from mjplug_schemas.message import Message

_REASONS = ("message", "status_message", "error_message", "reason")
"""Names of the text field beside `success` in ROS services, most common first."""

_OPERATION_FAILED = 4
"""RESULT_OPERATION_FAILED of simulation_interfaces."""


def refusal(response: type[Message], reason: str) -> Message | None:
    """Returns a response that contains the failure and the reason; None if the type has no field for it."""
    fields = response.model_fields
    if "result" in fields and getattr(fields["result"].annotation, "TYPE", "") == "simulation_interfaces/msg/Result":
        return response.model_validate({"result": {"result": _OPERATION_FAILED, "error_message": reason}})
    if "success" not in fields or fields["success"].annotation is not bool:
        return None
    text = next((name for name in _REASONS if name in set(_texts(fields))), None)
    return response(**{"success": False, **({text: reason} if text else {})})


def _texts(fields: dict[str, FieldInfo]) -> Iterator[str]:
    return (name for name, field in fields.items() if field.annotation is str)
