"""Settings of process and thread that keep steps on time. Each is skipped where the platform does not support it."""

import contextlib
import ctypes
import gc
import logging
import os
import platform
import re
import struct
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from time import monotonic
from weakref import WeakKeyDictionary

import mujoco

from mjplug.log_scope import current_scope
from mjplug.shared_change import SharedChange, Undo
from mjplug.throttle import Throttle

SWITCH_INTERVAL = 1e-4
"""Maximum time for which another thread keeps the GIL [s]; Python's default of 5 ms is as long as several steps."""

SLICE_NS = 100_000
"""Scheduler slice of the physics thread [ns]; Linux 6.12 and later schedule a thread with a short slice sooner."""

WARNING_INTERVAL = 10.0
"""Minimum wall time between two log lines with the same kind of MuJoCo warning [s]."""

_DIGIT = re.compile(r"\d")
_PR_SET_TIMERSLACK = 29
_SCHED_SETATTR = {"x86_64": 314, "aarch64": 274}

_log = logging.getLogger(__name__)


def configure_mujoco() -> None:
    """Sends MuJoCo's warnings to the log for the rest of the process; see `mujoco_configured`."""
    _MUJOCO.hold()


def mujoco_configured() -> AbstractContextManager[None]:
    """Sends MuJoCo's warnings to the log until the end of the block, instead of the console and MUJOCO_LOG.TXT.

    MuJoCo uses one warning function for all threads of a process. Warnings of a thread that belongs to no server are
    passed to the function that was set before, if any.

    MuJoCo's timer callback is removed during the block. It costs 0.75 µs a step; without it, `mjData.timer` stays zero.
    """
    return _MUJOCO.held()


def _configure_mujoco() -> Undo:
    logged, warned = mujoco.MjLogConfig.get(), mujoco.get_mju_user_warning()
    config = mujoco.MjLogConfig.get()
    config.logto_file = False
    config.logto_console = False
    mujoco.MjLogConfig.set(config)
    mujoco.set_mju_user_warning(_throttled_warnings(warned))
    timer = _timer_callback()
    timed = None if timer is None else timer.value
    clear_timer_callback()

    def undo() -> None:
        mujoco.MjLogConfig.set(logged)
        mujoco.set_mju_user_warning(warned)
        if timer is not None:
            timer.value = timed

    return undo


_MUJOCO = SharedChange(_configure_mujoco)


def _throttled_warnings(others: Callable[[str], None] | None) -> Callable[[str], None]:
    """Returns a function that logs MuJoCo's warnings, each kind of each server at most once in `WARNING_INTERVAL`.

    MuJoCo gives each kind of warning once until its counter is reset. The counters are reset after each divergence,
    which clients can cause repeatedly.

    Args:
        others: Called with the warnings of threads that belong to no server; if None, these are logged too.
    """
    of_scope: WeakKeyDictionary[object, dict[str, Throttle]] = WeakKeyDictionary()
    of_no_scope: dict[str, Throttle] = {}

    def warn(text: str) -> None:
        scope = current_scope()
        if scope is None and others is not None:
            others(text)
            return
        throttles = of_no_scope if scope is None else of_scope.setdefault(scope, {})
        # Warnings of one kind differ in their numbers.
        throttle = throttles.setdefault(_DIGIT.split(text, maxsplit=1)[0], Throttle(WARNING_INTERVAL))
        if throttle.admit(monotonic()):
            _log.warning("MuJoCo: %s%s", text, throttle.suppressed())

    return warn


def clear_timer_callback() -> bool:
    """Removes the callback for `mjData.timer`, which costs 0.75 µs a step; returns whether it was removed."""
    timer = _timer_callback()
    if timer is None:
        return False
    timer.value = None
    return True


def _timer_callback() -> ctypes.c_void_p | None:
    """Returns MuJoCo's variable `mjcb_time`; None if it is not found."""
    try:
        # The extension module has already loaded libmujoco, so this opens no further library.
        maps = Path("/proc/self/maps").read_text(encoding="utf-8")
        name = next(line.split()[-1] for line in maps.splitlines() if "libmujoco" in line)
        return ctypes.c_void_p.in_dll(ctypes.CDLL(name), "mjcb_time")
    except (OSError, StopIteration, ValueError):
        return None


def fast_thread_switching() -> AbstractContextManager[None]:
    """Shortens the interval in which Python switches threads, until the end of the block."""
    return _FAST_THREAD_SWITCHING.held()


def _set_switch_interval() -> Undo:
    before = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_INTERVAL)
    return lambda: sys.setswitchinterval(before)


_FAST_THREAD_SWITCHING = SharedChange(_set_switch_interval)


@contextlib.contextmanager
def frozen_garbage() -> Iterator[None]:
    """Excludes all existing objects from garbage collection until the end of the block.

    Use it only in a process that runs nothing but a server, because it affects all objects of the process.
    """
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def prefer_this_thread() -> dict[str, bool]:
    """Asks the kernel to wake the calling thread promptly; returns whether each setting took effect, by name."""
    return {"scheduler slice": _try(_set_slice), "timer slack": _try(_set_timer_slack)}


def _try(setting: Callable[[], None]) -> bool:
    try:
        setting()
    except (OSError, AttributeError, KeyError, TypeError):
        # On Windows, `os.getpriority` is missing and `CDLL(None)` is a TypeError.
        return False
    return True


def _set_timer_slack() -> None:
    _check(ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0))


def _set_slice() -> None:
    # struct sched_attr: u32 size, u32 policy, u64 flags, s32 nice, u32 priority, u64 runtime, u64 deadline, u64 period.
    attributes = struct.pack("=IIQiIQQQ", 48, 0, 0, os.getpriority(os.PRIO_PROCESS, 0), 0, SLICE_NS, 0, 0)
    if sys.platform != "linux":
        raise OSError("sched_setattr is available on Linux only")
    number = _SCHED_SETATTR[platform.machine()]
    _check(ctypes.CDLL(None, use_errno=True).syscall(number, 0, attributes, 0))


def _check(result: int) -> None:
    if result != 0:
        error = ctypes.get_errno()
        raise OSError(error, os.strerror(error))
