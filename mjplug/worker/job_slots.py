"""The two shared slots for states: one for the running job, one for the waiting job.

While a process works on one slot, newer states are written to the other. As soon as the process is done, the worker's
own thread sends it the waiting job, without waiting for the physics thread, which may be in a long step.
"""

import threading
from collections.abc import Callable
from typing import Any

from numpy.typing import NDArray

from mjplug.contracts.work import Job

Send = Callable[[int, Job], bool]
"""Sends a job and the index of its slot to a ready process; returns False if the process has ended."""


class JobSlots:
    """Takes jobs from the physics thread, and sends one at a time to a process. Thread-safe.

    The lock is held for microseconds: for a copy of the state, and for a short message to a waiting process.

    Attributes:
        dropped: How often a newer state replaced a waiting one, by task. Physics thread only.

    Args:
        slots: The shared states, shape (2, size).
        take: Writes the current state to an array of shape (size,).
    """

    def __init__(self, slots: NDArray[Any], take: Callable[[NDArray[Any]], None]) -> None:
        self.dropped: dict[str, int] = {}
        self._slots = (slots[0], slots[1])
        self._take = take
        self._free = 0
        self._waiting: Job | None = None
        self._running: Job | None = None
        self._send: Send | None = None
        self._closed = False
        self._lock = threading.Lock()

    @property
    def running(self) -> Job | None:
        """The job that the process performs; None if it performs none."""
        return self._running

    @property
    def settled(self) -> bool:
        """Whether no job runs or waits."""
        with self._lock:
            return self._waiting is None and self._running is None

    def put(self, time_ns: int, epoch: int, tasks: frozenset[str], context: Any = None, lineage: int = 0) -> bool:
        """Adds a job with the current state; returns False if the slots are closed. Physics thread only."""
        with self._lock:
            if self._closed:
                return False
            if self._waiting is not None:
                for task in tasks & self._waiting.tasks:
                    self.dropped[task] = self.dropped.get(task, 0) + 1
                tasks |= self._waiting.tasks
            self._take(self._slots[self._free])
            self._waiting = Job(time_ns, epoch, tasks, context, lineage)
            self._send_waiting()
            return True

    def connect(self, send: Send) -> None:
        """Starts sending jobs to a ready process, beginning with the waiting one."""
        with self._lock:
            if not self._closed:
                self._send = send
                self._send_waiting()

    def finish(self) -> Job | None:
        """Ends the running job, sends the waiting one to the process, and returns the ended job."""
        with self._lock:
            done, self._running = self._running, None
            self._send_waiting()
            return done

    def disconnect(self, keep_waiting: bool) -> frozenset[str]:
        """Handles the end of the process; returns the lost tasks.

        Args:
            keep_waiting: Whether the waiting job is kept for the next process; otherwise it is lost too.
        """
        with self._lock:
            self._send = None
            return self._lose(keep_waiting)

    def close(self) -> frozenset[str]:
        """Closes the slots, because no further process will be started; returns the lost tasks."""
        with self._lock:
            self._send = None
            self._closed = True
            return self._lose(keep_waiting=False)

    def _send_waiting(self) -> None:
        if self._send is None or self._running is not None or self._waiting is None:
            return
        # If the process has ended, the job waits for the next one.
        if self._send(self._free, self._waiting):
            self._running, self._waiting = self._waiting, None
            self._free = 1 - self._free

    def _lose(self, keep_waiting: bool) -> frozenset[str]:
        lost = self._running.tasks if self._running is not None else frozenset()
        self._running = None
        if self._waiting is not None and not keep_waiting:
            lost |= self._waiting.tasks
            self._waiting = None
        return lost
