"""Tells a worker process that hangs from one that works slowly or waits for a processor."""

import contextlib
from pathlib import Path

CHECK_INTERVAL = 1.0
"""How often a process is looked at [s]."""

SILENCE_TIMEOUT = 10.0
"""A process that sends nothing for so long, not even a sign of life, hangs [s]."""

OPEN_TIMEOUT = 60.0
"""How long a work may take to open, unless its jobs may take longer [s]."""

_MIN_COUNTED = 0.1
"""Part of the wall time that counts in any case, so that a job cannot take for ever on a machine that starves it."""


class HangDetector:
    """Measures how long a process has been silent, and how long it has been at one job.

    Time in which the process waited for a processor does not count: a slow renderer on a busy machine is left alone.
    Silence counts only while the process does not compute either: some library calls keep Python's other threads,
    among them the one that sends the signs of life, waiting for seconds. Linux tells both times; elsewhere, wall time
    counts. From any thread, one at a time; `message_received` at any time.

    Attributes:
        starved: Part of the time between the last two checks in which its threads waited for a processor, of that in
            which they wanted to compute.
        too_long: Whether `check` has found that it was at one thing for too long.

    Args:
        pid: The process.
        job_timeout: How long a job may take [s].
    """

    def __init__(self, pid: int, job_timeout: float) -> None:
        self.starved = 0.0
        self.too_long = False
        self._pid = pid
        self._job_timeout = job_timeout
        self._silent = self._spent = 0.0
        self._heard = True
        self._subject: object = None
        self._looked: float | None = None
        self._usage: tuple[float, float] | None = None

    def message_received(self) -> None:
        """A message came from the process."""
        self._heard = True

    def check(self, now: float, subject: object, opening: bool) -> str:
        """Returns why the process must be ended; empty if it need not.

        Args:
            now: By `monotonic` [s].
            subject: What the process is at; another object is another job, None is no job.
            opening: Whether the subject is the opening of the work.
        """
        # Not more than twice: then it was this thread that was late, or the whole machine that slept.
        elapsed = 0.0 if self._looked is None else min(now - self._looked, 2 * CHECK_INTERVAL)
        self._looked = now
        same, busy, self._subject = subject is not None and subject is self._subject, subject is not None, subject
        silent, self._heard = not self._heard, False
        if not same:
            self._spent = 0.0
        if not silent:
            self._silent = 0.0
        if not (busy or silent):
            self._usage, self.starved = None, 0.0
            return ""
        computed, waited = self._used()
        if computed + waited < elapsed and runnable(self._pid):
            # The system counts a wait for a processor when it is over; this one is not.
            waited = elapsed - computed
        self.starved = waited / (computed + waited) if waited else 0.0
        if same:
            self._spent += max(elapsed - waited, _MIN_COUNTED * elapsed)
        if silent:
            self._silent += max(elapsed - waited - computed, 0.0)
        if self._silent >= SILENCE_TIMEOUT:
            return f"nothing came from the process for {SILENCE_TIMEOUT:g} s"
        limit = max(self._job_timeout, OPEN_TIMEOUT) if opening else self._job_timeout
        if self._spent >= limit:
            self.too_long = True
            return f"{'opening it' if opening else 'a job'} took longer than {limit:g} s (job_timeout)"
        return ""

    def _used(self) -> tuple[float, float]:
        """Returns how long the threads computed, and how long they waited for a processor, since the last call [s]."""
        before, after = self._usage, usage(self._pid)
        self._usage = after
        if before is None or after is None:
            return 0.0, 0.0
        # Threads that have ended are missing in the later sum.
        return max(after[0] - before[0], 0.0), max(after[1] - before[1], 0.0)


def usage(pid: int) -> tuple[float, float] | None:
    """Returns how long all threads of a process have computed, and have waited for a processor [s].

    Returns:
        None where the system does not tell.
    """
    computed = waited = 0
    found = False
    for path in Path(f"/proc/{pid}/task").glob("*/schedstat"):
        # A thread may end meanwhile.
        with contextlib.suppress(OSError, ValueError):
            on_processor, in_queue, _ = path.read_text(encoding="ascii").split()
            computed, waited, found = computed + int(on_processor), waited + int(in_queue), True
    return (computed / 1e9, waited / 1e9) if found else None


def runnable(pid: int) -> bool:
    """Whether a thread of a process computes, or waits for a processor, at this moment; False where that is unknown."""
    for path in Path(f"/proc/{pid}/task").glob("*/stat"):
        with contextlib.suppress(OSError):
            # The name of the thread stands before it in parentheses, and may have some itself.
            if path.read_bytes().rpartition(b")")[2].split()[:1] == [b"R"]:
                return True
    return False
