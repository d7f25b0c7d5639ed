"""The messages that have arrived but are not written yet, bounded by their size."""

import threading
from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")

_OVERHEAD = 512
"""Size of a waiting message in addition to its payload [bytes]."""


class Backlog(Generic[T]):
    """A queue between Zenoh's threads, which must not wait, and the thread that writes. Thread-safe.

    Attributes:
        size: Number of bytes that wait.

    Args:
        limit: Maximum of `size` [bytes].
    """

    def __init__(self, limit: int) -> None:
        self.size = 0
        self._limit = limit
        self._items: deque[tuple[T, int]] = deque()
        self._changed = threading.Condition()
        self._woken = False

    def put(self, item: T, payload: int) -> bool:
        """Adds an item; returns whether there was room for it.

        Args:
            item: The item.
            payload: Size of its payload [bytes].
        """
        size = payload + _OVERHEAD
        with self._changed:
            if self.size + size > self._limit:
                return False
            self.size += size
            self._items.append((item, size))
            if len(self._items) == 1:
                self._changed.notify()
        return True

    def take(self, timeout: float, most: int = 256) -> list[T]:
        """Waits for items and removes the oldest.

        Args:
            timeout: How long to wait for the first one [s].
            most: Maximum number of items.
        """
        with self._changed:
            if not self._items and not self._woken:
                self._changed.wait(timeout)
            self._woken = False
            taken = [self._items.popleft() for _ in range(min(most, len(self._items)))]
            self.size -= sum(size for _, size in taken)
        return [item for item, _ in taken]

    def wake(self) -> None:
        """Ends a wait of `take`."""
        with self._changed:
            self._woken = True
            self._changed.notify()

    def clear(self) -> list[T]:
        """Removes and returns all items."""
        with self._changed:
            items = [item for item, _ in self._items]
            self._items.clear()
            self.size = 0
        return items
