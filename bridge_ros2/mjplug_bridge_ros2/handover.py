"""Passes calls from Zenoh's threads to the executor's thread."""

from collections import deque
from collections.abc import Callable
from typing import Any

import rclpy


class Handover:
    """Calls functions on the executor's thread, and wakes the executor.

    The functions are called in the order of the calls to `call`. The tasks of an executor have no defined order; in
    Humble, the newest task runs first.

    Args:
        executor: The executor.
    """

    def __init__(self, executor: Any) -> None:
        self._executor = executor
        self._calls: deque[tuple[Callable[..., Any], tuple[Any, ...]]] = deque()

    def call(self, function: Callable[..., Any], *arguments: Any) -> None:
        """Calls a function later on the executor's thread; can be used on any thread."""
        self._calls.append((function, arguments))
        try:
            self._executor.create_task(self._run)
        except Exception:
            # After an interrupt, the executor no longer exists.
            if rclpy.ok():
                raise

    def _run(self) -> None:
        while self._calls:
            function, arguments = self._calls.popleft()
            function(*arguments)
