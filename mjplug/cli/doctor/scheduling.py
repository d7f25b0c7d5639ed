"""Checks whether the kernel can wake the physics thread on time."""

import os
import threading
import time
from collections.abc import Callable, Iterator
from typing import TypeVar

from mjplug.cli.doctor.finding import Finding

T = TypeVar("T")

_TOPIC = "scheduling"
_NAPS = 300
_NAP = 1e-3
_LATE = 2e-3
"""Lateness that delays a step of 2 ms [s]."""


def check_scheduling() -> Iterator[Finding]:
    """Yields findings about scheduler settings, and about how late a sleeping thread wakes up."""
    from mjplug.physics import process

    for measure, holds in _in_a_thread(process.prefer_this_thread).items():
        if holds:
            yield Finding(_TOPIC, "ok", f"{measure}: can be set")
        else:
            yield Finding(_TOPIC, "note", f"{measure}: cannot be set here; steps start later", _fix())
    if process.clear_timer_callback():
        yield Finding(_TOPIC, "ok", "MuJoCo's step timer: can be switched off")
    else:
        yield Finding(_TOPIC, "note", "MuJoCo's step timer: cannot be switched off; a step takes 0.75 µs more")
    if not hasattr(os, "SCHED_IDLE"):
        yield Finding(
            _TOPIC,
            "note",
            "SCHED_IDLE: not available on this system; `priority: idle` of cameras and lidars means nice 19",
        )
    elif _in_a_thread(_may_be_idle):
        yield Finding(_TOPIC, "ok", "SCHED_IDLE: `priority: idle` of cameras and lidars can be set")
    else:
        yield Finding(
            _TOPIC,
            "warning",
            "SCHED_IDLE: not permitted; `priority: idle` of cameras and lidars has no effect",
            _fix(),
        )
    late = _lateness()
    measured = f"a thread that sleeps for 1 ms wakes up {late * 1e3:.2f} ms late, at the 99th percentile"
    if late < _LATE:
        yield Finding(_TOPIC, "ok", measured)
    else:
        yield Finding(
            _TOPIC, "warning", measured, "stop other busy programs, or give a virtual machine more or faster cores"
        )


def _fix() -> str:
    return "in a container: docker run --security-opt seccomp=unconfined, or run outside the container"


def _may_be_idle() -> bool:
    try:
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    except OSError:
        return False
    return True


def _in_a_thread(function: Callable[[], T]) -> T:
    """Calls a function in a separate thread, so that it changes no other thread."""
    result: list[T] = []
    thread = threading.Thread(target=lambda: result.append(function()))
    thread.start()
    thread.join()
    return result[0]


def _lateness() -> float:
    """Returns the 99th percentile of how late a sleeping thread wakes up [s]."""
    late = []
    for _ in range(_NAPS):
        wanted = time.perf_counter() + _NAP
        time.sleep(_NAP)
        late.append(time.perf_counter() - wanted)
    return sorted(late)[int(_NAPS * 0.99)]
