"""Reads whether a response reports a failure, as `mjplug.wire.refusal` writes it."""


def refusal_in(response):
    """Returns the reason of a response that reports a failure; None if it reports none, or cannot report one."""
    result = getattr(response, "result", None)
    if hasattr(result, "error_message"):
        return None if result.result == 1 else result.error_message
    return getattr(response, "message", "") if getattr(response, "success", True) is False else None
