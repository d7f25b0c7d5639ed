"""Which state a process works on, and which one waits: who may touch which of the two shared slots.

While a process is busy with one slot, newer states go to the other. The moment it is done, the worker's own thread
hands the waiting one over, without waiting for the physics thread, which may be in a long step.
"""

import threading
from collections.abc import Callable
from typing import Any

from numpy.typing import NDArray

from mjplug.contracts.work import Job

Send = Callable[[int, Job], bool]
"""Tells a ready process to perform a job in a slot; False if it is gone."""


class Handover:
    """Takes states from the physics thread, and gives one at a time to a process. From any thread.

    The lock is held for microseconds: a copy of the state, and a short message to a process that waits for it.

    Attributes:
        dropped: By task, how often a newer state took the place of one that had waited. Physics thread only.

    Args:
        slots: The shared states, of shape (2, size).
        take: Writes the present state.
    """

    def __init__(self, slots: NDArray[Any], take: Callable[[NDArray[Any]], None]) -> None:
        self.dropped: dict[str, int] = {}
        self._slots = (slots[0], slots[1])
        self._take = take
        self._free = 0
        self._waiting: Job | None = None
        self._under_way: Job | None = None
        self._send: Send | None = None
        self._closed = False
        self._lock = threading.Lock()

    @property
    def under_way(self) -> Job | None:
        """What the process is at; None if it is at nothing."""
        return self._under_way

    @property
    def settled(self) -> bool:
        """Whether everything has been performed or lost."""
        with self._lock:
            return self._waiting is None and self._under_way is None

    def put(self, time_ns: int, epoch: int, tasks: frozenset[str]) -> bool:
        """Notes the present state for some tasks; False when there will never be a process again. Physics thread."""
        with self._lock:
            if self._closed:
                return False
            if self._waiting is not None:
                for task in tasks & self._waiting.tasks:
                    self.dropped[task] = self.dropped.get(task, 0) + 1
                tasks |= self._waiting.tasks
            self._take(self._slots[self._free])
            self._waiting = Job(time_ns, epoch, tasks)
            self._hand_over()
            return True

    def connect(self, send: Send) -> None:
        """A process is ready: gives it what waits."""
        with self._lock:
            if not self._closed:
                self._send = send
                self._hand_over()

    def finish(self) -> Job | None:
        """The process is done: gives it what waits, and returns what was done."""
        with self._lock:
            done, self._under_way = self._under_way, None
            self._hand_over()
            return done

    def disconnect(self, keep_waiting: bool) -> frozenset[str]:
        """The process is gone: returns the tasks that are lost with it. What waits may wait for the next process."""
        with self._lock:
            self._send = None
            return self._lose(keep_waiting)

    def close(self) -> frozenset[str]:
        """There will be no process any more: returns the tasks that are lost."""
        with self._lock:
            self._send = None
            self._closed = True
            return self._lose(keep_waiting=False)

    def _hand_over(self) -> None:
        if self._send is None or self._under_way is not None or self._waiting is None:
            return
        # A process that is gone keeps it waiting, for the next one.
        if self._send(self._free, self._waiting):
            self._under_way, self._waiting = self._waiting, None
            self._free = 1 - self._free

    def _lose(self, keep_waiting: bool) -> frozenset[str]:
        lost = self._under_way.tasks if self._under_way is not None else frozenset()
        self._under_way = None
        if self._waiting is not None and not keep_waiting:
            lost |= self._waiting.tasks
            self._waiting = None
        return lost
