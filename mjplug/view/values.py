"""Values in requests of the page, as text for error messages."""

import json

_MAX_LENGTH = 80


def shown(value: object) -> str:
    """Returns a value as JSON, shortened if it is long."""
    text = json.dumps(value)
    return text if len(text) <= _MAX_LENGTH else f"{text[:_MAX_LENGTH]}… ({len(text)} characters)"
