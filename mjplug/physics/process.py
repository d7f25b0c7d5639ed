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
from pathlib import Path
from time import monotonic

import mujoco

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
    """Routes MuJoCo's warnings to our log, not to console and MUJOCO_LOG.TXT; removes its per-step timer callback."""
    config = mujoco.MjLogConfig.get()
    config.logto_file = False
    config.logto_console = False
    mujoco.MjLogConfig.set(config)
    mujoco.set_mju_user_warning(_throttled_warnings())
    clear_timer_callback()


def _throttled_warnings() -> Callable[[str], None]:
    """Returns what logs MuJoCo's warnings, each kind at most once in `WARNING_SECONDS`.

    MuJoCo warns once of each kind until it is told to forget, as after each divergence, which clients can repeat.
    """
    throttles: dict[str, Throttle] = {}

    def warn(text: str) -> None:
        # Warnings of one kind differ in their numbers.
        throttle = throttles.setdefault(_DIGIT.split(text, maxsplit=1)[0], Throttle(WARNING_SECONDS))
        if throttle.admit(monotonic()):
            _log.warning("MuJoCo: %s%s", text, throttle.held())

    return warn


def clear_timer_callback() -> bool:
    """Removes the timer of `mjData.timer`, which costs 0.75 µs a step; returns whether it is gone."""
    try:
        # The extension module has loaded libmujoco already, so the symbol is there without opening a file.
        maps = Path("/proc/self/maps").read_text(encoding="utf-8")
        name = next(line.split()[-1] for line in maps.splitlines() if "libmujoco" in line)
        ctypes.c_void_p.in_dll(ctypes.CDLL(name), "mjcb_time").value = None
    except (OSError, StopIteration, ValueError):
        return False
    return True


@contextlib.contextmanager
def quick_switching() -> Iterator[None]:
    """Lets threads change quickly, and keeps the garbage collector off what was loaded before."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_INTERVAL)
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
        sys.setswitchinterval(before)


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
