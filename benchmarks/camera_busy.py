"""A camera beside two busy programs: image rate, and lateness of physics."""

import statistics
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from benchmarks.camera import RATE, SECONDS, TOPICS, Listener, run_for_a_while, served
from benchmarks.lateness import p99_in_thread
from benchmarks.measure import Result

PROGRAMS, REPEATS = 2, 5


def results() -> list[Result]:
    """Alternates physics with and without a camera subscriber, while two programs use all processor time."""
    images: list[int] = []
    with served("bundled:arm") as (server, endpoint), Listener(endpoint) as listener:

        def measure(listening: bool) -> float:
            def work(late: list[float]) -> None:
                if listening:
                    listener.begin()
                run_for_a_while(server, late)
                if listening:
                    images.append(listener.end())

            return p99_in_thread(work)

        # The worker process starts in this turn.
        measure(True)
        images.clear()
        with _busy_programs():
            late = [(measure(True), measure(False)) for _ in range(REPEATS)]
    ratios = [ours / other for ours, other in late]
    load = f"with {PROGRAMS} busy programs"
    medians = [f"{statistics.median(column):.0f} µs" for column in zip(*late, strict=True)]
    rates = [count / len(TOPICS) / SECONDS for count in images]
    rate = statistics.median(rates)
    return [
        Result(
            f"images/s of a {RATE:g} Hz 640x480 camera {load}",
            f"{rate:.1f}/s",
            "",
            rate,
            min(rates),
            max(rates),
            f">= {RATE / 3:g}",
        ),
        Result(
            f"p99 lateness of a step at 1 kHz {load} and a 30 Hz camera, against no subscriber (5 x 4 s)",
            *medians,
            statistics.median(ratios),
            min(ratios),
            max(ratios),
            "<= 1.5",
        ),
    ]


@contextmanager
def _busy_programs() -> Iterator[None]:
    programs = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(PROGRAMS)]
    try:
        yield
    finally:
        for program in programs:
            program.kill()
            program.wait()
