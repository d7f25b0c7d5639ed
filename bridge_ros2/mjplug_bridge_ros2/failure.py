"""Turns a failure into a response: a ROS client can wait for ever, but cannot be told of an error in any other way."""

from typing import Any

_SENTENCES = ("message", "status_message", "error_message")
_SIMULATION_RESULT = "simulation_interfaces/Result"


def fill_in(response: Any, sentence: str) -> bool:
    """Writes a failure into a response of any type.

    Args:
        response: A response with its initial values.
        sentence: What went wrong.

    Returns:
        Whether the type has a place that tells a failure from a success.
    """
    fields = response.get_fields_and_field_types()
    for name in _SENTENCES:
        if fields.get(name) == "string":
            setattr(response, name, sentence)
    if fields.get("success") == "boolean":
        response.success = False
        return True
    if fields.get("result") == _SIMULATION_RESULT:
        response.result.result = response.result.RESULT_OPERATION_FAILED
        response.result.error_message = sentence
        return True
    return False
