"""Messages that are prepared on the transport's thread, so that physics does not wait while they are checked."""

from collections.abc import Callable
from typing import Any

Prepare = Callable[[Any], Any]
"""Returns what a handler gets in place of a message. Runs on the transport's thread; it must use constant data only."""


class Prepared:
    """What `prepare` has returned for a message, or the exception that it has raised.

    Args:
        prepare: The function.
        message: The message.
    """

    def __init__(self, prepare: Prepare, message: Any) -> None:
        self._prepare, self._message = prepare, message
        self._value: Any = None
        self._error: Exception | None = None
        try:
            self._value = prepare(message)
        except Exception as error:
            self._error = error

    def get(self, prepare: Prepare | None = None) -> Any:
        """Returns the value, or raises the exception. Physics thread, where exceptions of plugins are handled.

        Args:
            prepare: The present function, if it may have changed since; the message is then prepared again.
        """
        if prepare is not None and prepare is not self._prepare:
            return prepare(self._message)
        if self._error is not None:
            raise self._error
        return self._value
