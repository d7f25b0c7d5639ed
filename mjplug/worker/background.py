"""How a worker process behaves towards the rest of the machine; what a platform lacks is left out quietly."""

import contextlib
import ctypes
import os
import signal
import sys
import threading
import time

_PR_SET_PDEATHSIG = 1
_GLANCE = 0.2
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


def give_way() -> None:
    """Lets this thread, and those it will start, run only while nobody else wants to.

    Rendering in software takes every core it can get, and would make physics late by milliseconds; `nice` does not
    help against that.
    """
    if sys.platform == "linux":
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_GLANCE)
    os._exit(1)
