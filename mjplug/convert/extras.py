"""Optional libraries, and the sentence that says how to install a missing one."""

import importlib
from typing import Any

from mjplug.errors import ModelError

CONVERT = "convert"
DECOMPOSE = "decompose"


def required(module: str, purpose: str, extra: str = CONVERT) -> Any:
    """Imports a library of an extra.

    Args:
        module: The module.
        purpose: What needs it; the subject of the sentence in the error.
        extra: The extra that contains it.

    Raises:
        ModelError: It is not installed.
    """
    found = optional(module)
    if found is None:
        raise ModelError(
            f"{purpose} needs the Python library `{module}`, which is not installed: pip install 'mjplug[{extra}]'"
        )
    return found


def optional(module: str) -> Any:
    """Imports a library if it is installed; otherwise returns None."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != module.partition(".")[0]:
            raise
        return None
