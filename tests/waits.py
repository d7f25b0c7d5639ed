"""Waits for what must happen, as long as a machine with other work may need."""

import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")

TIMEOUT = 60.0
"""How long anything may take that is not broken [s]; on a quiet machine, it takes milliseconds."""

_INTERVAL = 0.01


def until(condition: Callable[[], T], timeout: float = TIMEOUT) -> T:
    """Waits until a condition is true, and returns its value; fails if this takes too long."""
    end = time.monotonic() + timeout
    while not (found := condition()):
        assert time.monotonic() < end, f"not within {timeout:g} s"
        time.sleep(_INTERVAL)
    return found
