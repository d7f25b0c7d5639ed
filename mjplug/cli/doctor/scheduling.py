"""Whether steps can be on time."""

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
"""Lateness that a step of 2 ms would feel [s]."""


def check_scheduling() -> Iterator[Finding]:
    """Yields what the kernel lets a server do for its punctuality, and how late it wakes up."""
    from mjplug.physics import process

    for measure, holds in _in_a_thread(process.prefer_this_thread).items():
        if holds:
            yield Finding(_TOPIC, "ok", f"{measure}: can be set")
        else:
            yield Finding(_TOPIC, "note", f"{measure}: cannot be set here; steps are less punctual", _fix())
    if process.clear_timer_callback():
        yield Finding(_TOPIC, "ok", "MuJoCo's step timer: can be switched off")
    else:
        yield Finding(_TOPIC, "note", "MuJoCo's step timer: cannot be switched off; a step takes 0.75 µs more")
    if not hasattr(os, "SCHED_IDLE"):
        yield Finding(
            _TOPIC, "note", "SCHED_IDLE: this system has none, so `priority: idle` of cameras and lidars is nice 19"
        )
    elif _in_a_thread(_may_be_idle):
        yield Finding(_TOPIC, "ok", "SCHED_IDLE: `priority: idle` of cameras and lidars can be set")
    else:
        yield Finding(
            _TOPIC,
            "warning",
            "SCHED_IDLE: not allowed, so `priority: idle` of cameras and lidars has no effect",
            _fix(),
        )
    late = _lateness()
    said = f"a thread that sleeps for 1 ms wakes up {late * 1e3:.2f} ms late, at the 99th percentile"
    if late < _LATE:
        yield Finding(_TOPIC, "ok", said)
    else:
        yield Finding(
            _TOPIC, "warning", said, "end what keeps the machine busy, or give a virtual machine more or faster cores"
        )


def _fix() -> str:
    return "in a container: docker run --security-opt seccomp=unconfined, or run outside of it"


def _may_be_idle() -> bool:
    try:
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    except OSError:
        return False
    return True


def _in_a_thread(function: Callable[[], T]) -> T:
    """Calls a function in a thread of its own, which alone it changes."""
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
