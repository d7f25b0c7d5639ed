"""Distinguishes a worker process that hangs from one that is slow or waits for a CPU."""

import contextlib
from pathlib import Path

CHECK_INTERVAL = 1.0
"""Interval between two checks of a process [s]."""

SILENCE_TIMEOUT = 10.0
"""A process that sends no message for this time, not even a heartbeat, hangs [s]."""

OPEN_TIMEOUT = 60.0
"""Maximum time for opening a work, unless its `job_timeout` is longer [s]."""

_MIN_COUNTED_SHARE = 0.1
"""Minimum share of the wall time that counts, so that a job times out even if the process never gets a CPU."""


class HangDetector:
    """Measures how long a process has sent no message, and how long its job takes.

    Time in which the process waited for a CPU does not count, so that a slow renderer on a busy machine is not killed.
    Silence counts only while the process does not compute, because some library calls block Python's other threads,
    including the one that sends heartbeats, for seconds. Linux reports both times; on other systems, wall time counts.
    Call `check` from one thread at a time; `message_received` may be called from any thread at any time.

    Attributes:
        starved: Share of its runnable time between the last two checks in which the process waited for a CPU, 0 to 1.
        too_long: Whether `check` has found that a job, or opening the work, took too long.

    Args:
        pid: The process id.
        job_timeout: Maximum time of a job [s].
    """

    def __init__(self, pid: int, job_timeout: float) -> None:
        self.starved = 0.0
        self.too_long = False
        self._pid = pid
        self._job_timeout = job_timeout
        self._silent = self._spent = 0.0
        self._message_seen = True
        self._subject: object = None
        self._checked_at: float | None = None
        self._usage: tuple[float, float] | None = None

    def message_received(self) -> None:
        """Records that the process has sent a message."""
        self._message_seen = True

    def check(self, now: float, subject: object, opening: bool) -> str:
        """Returns why the process must be killed; empty if it does not hang.

        Args:
            now: Time by `monotonic` [s].
            subject: The current job; another object means another job, None means no job.
            opening: Whether the process opens the work instead of performing a job.
        """
        # Limited, because a longer time means that this thread was late or that the machine was suspended.
        elapsed = 0.0 if self._checked_at is None else min(now - self._checked_at, 2 * CHECK_INTERVAL)
        self._checked_at = now
        same, busy, self._subject = subject is not None and subject is self._subject, subject is not None, subject
        silent, self._message_seen = not self._message_seen, False
        if not same:
            self._spent = 0.0
        if not silent:
            self._silent = 0.0
        if not (busy or silent):
            self._usage, self.starved = None, 0.0
            return ""
        computed, waited = self._used()
        if computed + waited < elapsed and runnable(self._pid):
            # The kernel counts a wait for a CPU only when it is over; this one still lasts.
            waited = elapsed - computed
        self.starved = waited / (computed + waited) if waited else 0.0
        if same:
            self._spent += max(elapsed - waited, _MIN_COUNTED_SHARE * elapsed)
        if silent:
            self._silent += max(elapsed - waited - computed, 0.0)
        if self._silent >= SILENCE_TIMEOUT:
            return f"the process sent no message for {SILENCE_TIMEOUT:g} s"
        limit = max(self._job_timeout, OPEN_TIMEOUT) if opening else self._job_timeout
        if self._spent >= limit:
            self.too_long = True
            return f"{'opening the work' if opening else 'a job'} took longer than {limit:g} s (job_timeout)"
        return ""

    def _used(self) -> tuple[float, float]:
        """Returns how long the threads computed, and how long they waited for a CPU, since the last call [s]."""
        before, after = self._usage, usage(self._pid)
        self._usage = after
        if before is None or after is None:
            return 0.0, 0.0
        # The later sum does not include threads that have ended.
        return max(after[0] - before[0], 0.0), max(after[1] - before[1], 0.0)


def usage(pid: int) -> tuple[float, float] | None:
    """Returns how long all threads of a process have computed, and how long they have waited for a CPU [s].

    Returns None if the operating system does not report it.
    """
    computed = waited = 0
    found = False
    for path in Path(f"/proc/{pid}/task").glob("*/schedstat"):
        # A thread may end during the loop.
        with contextlib.suppress(OSError, ValueError):
            on_processor, in_queue, _ = path.read_text(encoding="ascii").split()
            computed, waited, found = computed + int(on_processor), waited + int(in_queue), True
    return (computed / 1e9, waited / 1e9) if found else None


def runnable(pid: int) -> bool:
    """Returns whether a thread of a process computes or waits for a CPU now; False if this is unknown."""
    for path in Path(f"/proc/{pid}/task").glob("*/stat"):
        with contextlib.suppress(OSError):
            # The thread's name comes before the state, in parentheses, and may itself contain parentheses.
            if path.read_bytes().rpartition(b")")[2].split()[:1] == [b"R"]:
                return True
    return False
