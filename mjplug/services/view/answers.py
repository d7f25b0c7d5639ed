"""Answers to queries for what the view's worker makes once."""

from collections.abc import Callable
from typing import Generic, TypeVar

from mjplug.contracts.transport import BytesQuery
from mjplug.physics.inbox import Inbox

T = TypeVar("T")


class MadeOnce(Generic[T]):
    """A value that the worker makes at the first query; queries that arrive before it is made wait for it.

    Args:
        inbox: The inbox of the physics thread.
        what: What it is, for refusals.
    """

    def __init__(self, inbox: Inbox, what: str) -> None:
        self.value: T | None = None
        self._inbox = inbox
        self._what = what
        self._waiting: list[Callable[[T | None, str], None]] = []

    def answer(self, query: BytesQuery, reply: Callable[[BytesQuery, T], None], request: Callable[[], None]) -> None:
        """Answers a query, at once if the value has been made. Any thread.

        Args:
            query: The query.
            reply: Replies to the query with the value.
            request: Lets the worker make the value; called on the physics thread.
        """
        if (value := self.value) is not None:
            reply(query, value)
            return

        def finish(made: T | None, reason: str) -> None:
            if made is None:
                query.refuse(f"the {self._what} cannot be made: {reason}")
            else:
                reply(query, made)

        self._inbox.post(lambda: self._wait(finish, request))

    def forget(self) -> None:
        """Discards the value, which belongs to another model; the next query lets it be made again. Physics thread."""
        self.value = None

    def made(self, value: T) -> None:
        """Answers the queries that wait. Physics thread."""
        self.value = value
        self._finish(value, "")

    def lost(self, reason: str) -> None:
        """Refuses the queries that wait. Physics thread."""
        self._finish(None, reason)

    def _wait(self, finish: Callable[[T | None, str], None], request: Callable[[], None]) -> None:
        if self.value is not None:
            finish(self.value, "")
            return
        self._waiting.append(finish)
        if len(self._waiting) == 1:
            request()

    def _finish(self, value: T | None, reason: str) -> None:
        waiting, self._waiting = self._waiting, []
        for finish in waiting:
            finish(value, reason)
