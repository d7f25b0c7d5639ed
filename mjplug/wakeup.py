"""Waits that Ctrl-C may interrupt at any point, without effect on the threads that end them.

`threading.Condition` and `threading.Event` are written in Python. If Ctrl-C arrives just after one of them has acquired
its lock, KeyboardInterrupt is raised before the block of the `with` statement, which would release the lock. The lock
stays held, and the next thread that reports a change blocks for ever. If that is a thread of Zenoh, the session cannot
be closed any more.
"""

import threading
from collections.abc import Callable
from contextlib import suppress
from time import monotonic
from typing import TypeVar

T = TypeVar("T")


class Wakeup:
    """Wakes threads that wait for a change. Thread-safe; `notify` may also be called from a signal handler.

    There is no lock around what changes: use operations that are atomic, such as those of `collections.deque`.
    """

    def __init__(self) -> None:
        # One lock for each waiting thread, which the thread tries to acquire twice: `notify` releases it in between.
        self._waiting: list[threading.Lock] = []

    def notify(self) -> None:
        """Lets all waiting threads look again."""
        for lock in tuple(self._waiting):
            # An error if an earlier call has already released it.
            with suppress(RuntimeError):
                lock.release()

    def wait_for(self, look: Callable[[], T], timeout: float | None = None) -> T:
        """Waits until a function returns a true value, and returns its last value.

        Args:
            look: The function; called at the beginning and after each `notify`, on the calling thread.
            timeout: How long to wait [s]; None for no limit.
        """
        found = look()
        if found or timeout == 0.0:
            return found
        until = None if timeout is None else monotonic() + timeout
        lock = threading.Lock()
        lock.acquire()
        try:
            self._waiting.append(lock)
            while not (found := look()):
                left = -1.0 if until is None else until - monotonic()
                if until is not None and left <= 0.0:
                    break
                lock.acquire(timeout=left)
            return found
        finally:
            # Another interrupt here may leave the lock in the list, where it does no harm.
            if lock in self._waiting:
                self._waiting.remove(lock)


class Flag:
    """A value that is false or true, and can be waited for; like `threading.Event`. Thread-safe."""

    def __init__(self) -> None:
        self._value = False
        self._changed = Wakeup()

    def __bool__(self) -> bool:
        return self._value

    def set(self) -> None:
        """Makes it true, and wakes the threads that wait for it."""
        self._value = True
        self._changed.notify()

    def clear(self) -> None:
        """Makes it false."""
        self._value = False

    def wait(self, timeout: float | None = None) -> bool:
        """Waits until it is true, and returns whether it is.

        Args:
            timeout: How long to wait [s]; None for no limit.
        """
        return self._changed.wait_for(lambda: self._value, timeout)
