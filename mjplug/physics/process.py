"""Settings of process and thread that keep steps on time; each degrades quietly where the platform lacks it."""

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
"""How long [s] another thread may keep the GIL from the physics thread; Python's 5 ms are many steps."""

SLICE_NS = 100_000
"""Scheduler slice of the physics thread [ns]; Linux 6.12 and later run a thread with a short one soon."""

WARNING_SECONDS = 10.0
"""Wall time between two log lines with the same kind of warning from MuJoCo [s]."""

_DIGIT = re.compile(r"\d")
_PR_SET_TIMERSLACK = 29
_SCHED_SETATTR = {"x86_64": 314, "aarch64": 274}

_log = logging.getLogger(__name__)


def tame_mujoco() -> None:
    """Routes MuJoCo's warnings to our log for the rest of the process; see `mujoco_tamed`."""
    _MUJOCO.hold()


def mujoco_tamed() -> AbstractContextManager[None]:
    """Routes MuJoCo's warnings to our log until the end of the block.

    They go neither to the console nor to MUJOCO_LOG.TXT. MuJoCo has one warning function for all threads of a process:
    the warnings of a thread that works for no server go to the function that was set before, if there was one.

    MuJoCo's timer callback is removed meanwhile. It costs 0.75 µs a step; without it, `mjData.timer` stays zero.
    """
    return _MUJOCO.held()


def _tame_mujoco() -> Undo:
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


_MUJOCO = SharedChange(_tame_mujoco)


def _throttled_warnings(others: Callable[[str], None] | None) -> Callable[[str], None]:
    """Returns what logs MuJoCo's warnings, each kind of each server at most once in `WARNING_SECONDS`.

    MuJoCo warns once of each kind until it is told to forget, as after each divergence, which clients can repeat.

    Args:
        others: Gets the warnings of threads that work for no server; None logs them too.
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
        throttle = throttles.setdefault(_DIGIT.split(text, maxsplit=1)[0], Throttle(WARNING_SECONDS))
        if throttle.admit(monotonic()):
            _log.warning("MuJoCo: %s%s", text, throttle.held())

    return warn


def clear_timer_callback() -> bool:
    """Removes the timer of `mjData.timer`, which costs 0.75 µs a step; returns whether it is gone."""
    timer = _timer_callback()
    if timer is None:
        return False
    timer.value = None
    return True


def _timer_callback() -> ctypes.c_void_p | None:
    """Returns MuJoCo's variable `mjcb_time`; None where it cannot be found."""
    try:
        # The extension module has loaded libmujoco already, so the symbol is there without opening a file.
        maps = Path("/proc/self/maps").read_text(encoding="utf-8")
        name = next(line.split()[-1] for line in maps.splitlines() if "libmujoco" in line)
        return ctypes.c_void_p.in_dll(ctypes.CDLL(name), "mjcb_time")
    except (OSError, StopIteration, ValueError):
        return None


def quick_switching() -> AbstractContextManager[None]:
    """Lets threads change quickly until the end of the block."""
    return _QUICK_SWITCHING.held()


def _switch_quickly() -> Undo:
    before = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_INTERVAL)
    return lambda: sys.setswitchinterval(before)


_QUICK_SWITCHING = SharedChange(_switch_quickly)


@contextlib.contextmanager
def frozen_garbage() -> Iterator[None]:
    """Keeps the garbage collector off what was loaded before, until the end of the block.

    For a process that does nothing but serve: objects of others would be kept too.
    """
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def prefer_this_thread() -> dict[str, bool]:
    """Asks the kernel to wake the calling thread promptly; returns which measures hold."""
    return {"scheduler slice": _try(_set_slice), "timer slack": _try(_set_timer_slack)}


def _try(measure: Callable[[], None]) -> bool:
    try:
        measure()
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
        raise OSError("only Linux has sched_setattr")
    number = _SCHED_SETATTR[platform.machine()]
    _check(ctypes.CDLL(None, use_errno=True).syscall(number, 0, attributes, 0))


def _check(result: int) -> None:
    if result != 0:
        error = ctypes.get_errno()
        raise OSError(error, os.strerror(error))
