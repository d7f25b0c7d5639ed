"""Runs work on files on a thread of its own, so that a slow disk does not delay steps."""

from collections.abc import Callable, Generator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

from mjplug.errors import RequestError
from mjplug.physics.inbox import Inbox
from mjplug.physics.scheduler import Event, Wait

MAX_WAITING = 16
"""Maximum number of calls that wait or run."""

T = TypeVar("T")


class FileThread:
    """Runs one call after the other. Physics thread only, except the calls.

    Args:
        inbox: The inbox of the physics thread.
    """

    def __init__(self, inbox: Inbox) -> None:
        self._inbox = inbox
        self._waiting = 0
        self._executor: ThreadPoolExecutor | None = None

    def run(self, call: Callable[[], T]) -> Generator[Wait, None, T]:
        """Runs a call, while the service that yields from this waits; returns its result or raises its exception.

        Raises:
            RequestError: Too many calls wait already.
        """
        if self._waiting >= MAX_WAITING:
            raise RequestError(f"{self._waiting} requests for files are waiting, which is the maximum; try again later")
        if self._executor is None:
            self._executor = ThreadPoolExecutor(1, "mjplug states")
        done = Event()
        self._waiting += 1
        future: Future[T] = self._executor.submit(call)

        def ended() -> None:
            self._waiting -= 1
            done.set()

        future.add_done_callback(lambda _: self._inbox.post(ended))
        yield done
        return future.result()

    def close(self) -> None:
        """Waits for the calls that run, and discards those that wait."""
        if self._executor is not None:
            self._executor.shutdown(cancel_futures=True)
