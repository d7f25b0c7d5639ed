"""How a worker process behaves towards the rest of the machine; what a platform lacks is left out quietly."""

import contextlib
import ctypes
import os
import signal
import sys
import threading
import time

_PR_SET_PDEATHSIG = 1
_NICE = 5
"""Added to the niceness of the server for `low`: about a third of the processor time of a program with its niceness."""

_LOWEST = 19
"""Niceness for `idle` where there is no SCHED_IDLE."""

_POLL_INTERVAL = 0.2
"""How often a process looks whether the server still lives, where the kernel cannot tell it [s]."""


def ignore_signals() -> None:
    """Leaves Ctrl-C and polite requests to the server, which ends its processes itself, by closing their input."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


def die_with(parent: int) -> None:
    """Ends this process when the server's, or the thread of it that started this one, is gone.

    Waiting for the end of the input is not enough: a job may take long, and a library may hang.

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


def take_priority(priority: str) -> None:
    """Sets how much processor time this thread, and those it will start, get beside other programs.

    `idle` is Linux's SCHED_IDLE: it runs only while no other program wants to, and starves beside busy ones. `low` has
    a third of the weight of a normal program (nice 5), and with SCHED_BATCH it never interrupts a running thread, so
    that physics is not delayed when a worker wakes up. `normal` changes nothing.

    Args:
        priority: `idle`, `low` or `normal`.
    """
    if sys.platform == "win32" or priority == "normal":
        return
    if sys.platform == "linux":
        # A container may forbid it; `nice` alone then is better than nothing.
        with contextlib.suppress(OSError):
            policy = os.SCHED_IDLE if priority == "idle" else os.SCHED_BATCH
            os.sched_setscheduler(0, policy, os.sched_param(0))
    with contextlib.suppress(OSError):
        os.nice(_NICE if priority == "low" else _LOWEST)


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_POLL_INTERVAL)
    os._exit(1)
