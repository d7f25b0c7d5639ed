"""From Zenoh's threads to the executor's."""

from collections import deque
from collections.abc import Callable
from typing import Any

import rclpy


class Handover:
    """Has functions called on the executor's thread, and wakes it.

    They are called in the order in which they were handed over. The tasks of an executor alone are not: rclpy does not
    promise any order, and that of Humble begins with the latest.

    Args:
        executor: The executor.
    """

    def __init__(self, executor: Any) -> None:
        self._executor = executor
        self._calls: deque[tuple[Callable[..., Any], tuple[Any, ...]]] = deque()

    def call(self, function: Callable[..., Any], *arguments: Any) -> None:
        """Calls a function later; may be used on any thread."""
        self._calls.append((function, arguments))
        try:
            self._executor.create_task(self._run)
        except Exception:
            # After an interrupt there is nothing to wake any more.
            if rclpy.ok():
                raise

    def _run(self) -> None:
        while self._calls:
            function, arguments = self._calls.popleft()
            function(*arguments)
