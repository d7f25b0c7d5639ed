"""Lateness of steps at 1 kHz in real time, compared with a sleep loop that steps the same model."""

import threading
from collections.abc import Callable
from time import perf_counter, sleep

import mujoco
import numpy as np

from benchmarks.measure import Result, pairs
from benchmarks.world import SMALL, model_of, server
from mjplug.physics import process

SECONDS, PERIOD = 2.0, 0.001


def p99_in_thread(work: Callable[[list[float]], None]) -> float:
    """Runs `work` in a thread with the server's settings; returns the 99th percentile of the lateness [µs]."""
    late: list[float] = []

    def run() -> None:
        with process.frozen_garbage(), process.fast_thread_switching():
            process.prefer_this_thread()
            work(late)

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    return float(np.percentile(late, 99)) * 1e6


def _served(late: list[float]) -> None:
    with server(SMALL, speed=1.0, timestep=PERIOD) as (served, _):
        loop = served.loop
        step = loop.simulation.time.steps_per(PERIOD)
        loop.scheduler.every(step, lambda: late.append(perf_counter() - loop.pacer.deadline(loop.simulation.step)), 0)
        loop.last_step = int(SECONDS / PERIOD)
        loop.run()


def _bare(late: list[float]) -> None:
    model = model_of(SMALL)
    model.opt.timestep = PERIOD
    data = mujoco.MjData(model)
    start = perf_counter()
    for k in range(1, int(SECONDS / PERIOD) + 1):
        deadline = start + k * PERIOD
        sleep(max(0.0, deadline - perf_counter()))
        mujoco.mj_step(model, data)
        late.append(perf_counter() - deadline)


def results() -> list[Result]:
    """Measures both alternately, five times two seconds each."""
    what = "p99 lateness of a step at 1 kHz in real time (5 x 2 s), against a bare sleep loop"
    return [pairs(what, lambda: p99_in_thread(_served), lambda: p99_in_thread(_bare), "<= 2", "{:.0f} µs", repeats=5)]
