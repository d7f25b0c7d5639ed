"""Signals, parent process and CPU priority of a worker process. Settings that the platform lacks are skipped."""

import contextlib
import ctypes
import os
import signal
import sys
import threading
import time

_PR_SET_PDEATHSIG = 1
_LOW_NICENESS = 5
"""Added to the server's niceness for `low`: about a third of the CPU time of a program with the server's niceness."""

_IDLE_NICENESS = 19
"""Niceness for `idle` if SCHED_IDLE is not available."""

_POLL_INTERVAL = 0.2
"""Interval at which a process checks whether the server still runs, if the kernel cannot signal it [s]."""


def ignore_signals() -> None:
    """Ignores SIGINT and SIGTERM. The server handles them and ends its processes by closing their input."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


def exit_with_parent(parent: int) -> None:
    """Ends this process when the server's process, or its thread that started this process, has ended.

    The end of the input is not sufficient, because a job may take long and a library may hang.

    Args:
        parent: The server's process id.
    """
    if sys.platform == "linux":
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
        if os.getppid() != parent:
            os._exit(1)
    elif sys.platform != "win32":
        threading.Thread(target=_watch, args=(parent,), name="parent", daemon=True).start()


def set_priority(priority: str) -> None:
    """Sets the CPU priority of this thread and of the threads that it will start.

    `idle` is Linux's SCHED_IDLE: the thread runs only when no other program uses the CPU. `low` has a third of the
    weight of a normal program (nice 5), and with SCHED_BATCH it never preempts a running thread, so that a worker that
    wakes up does not delay physics. `normal` changes nothing.

    Args:
        priority: `idle`, `low` or `normal`.
    """
    if sys.platform == "win32" or priority == "normal":
        return
    if sys.platform == "linux":
        # A container may forbid this; `nice` then still takes effect.
        with contextlib.suppress(OSError):
            policy = os.SCHED_IDLE if priority == "idle" else os.SCHED_BATCH
            os.sched_setscheduler(0, policy, os.sched_param(0))
    with contextlib.suppress(OSError):
        os.nice(_LOW_NICENESS if priority == "low" else _IDLE_NICENESS)


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_POLL_INTERVAL)
    os._exit(1)
