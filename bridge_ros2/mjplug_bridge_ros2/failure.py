"""Writes an error into a service response, because ROS 2 services cannot return errors in another way."""

from typing import Any

_MESSAGE_FIELDS = ("message", "status_message", "error_message")
_SIMULATION_RESULT = "simulation_interfaces/Result"


def fill_in(response: Any, message: str) -> bool:
    """Writes an error into a response of any type.

    Args:
        response: A response with its initial values.
        message: The error message.

    Returns:
        Whether the type has a field that distinguishes failure from success.
    """
    fields = response.get_fields_and_field_types()
    for name in _MESSAGE_FIELDS:
        if fields.get(name) == "string":
            setattr(response, name, message)
    if fields.get("success") == "boolean":
        response.success = False
        return True
    if fields.get("result") == _SIMULATION_RESULT:
        response.result.result = response.result.RESULT_OPERATION_FAILED
        response.result.error_message = message
        return True
    return False
