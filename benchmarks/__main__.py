"""Runs every measurement, prints one table and writes it to docs/benchmarks.md."""

import os
import platform
import sys
from importlib.metadata import version
from pathlib import Path

from benchmarks import (
    camera,
    camera_busy,
    free_joints,
    joints,
    lateness,
    lidar,
    lockstep,
    publication,
    rmw_zenoh,
    round_trip,
    steps,
    view,
)
from benchmarks.measure import Result

PAGE = Path(__file__).parent.parent / "docs" / "benchmarks.md"

_INTRODUCTION = """# Benchmarks

`make bench` writes this page. It measures mjplug and the alternative in turns within one run, because the speed of a
shared machine varies. The ratio is the median of the pairs, with the smallest and the largest in brackets. The absolute
values are from one run on one machine.
"""


def _table(results: list[Result]) -> str:
    rows = ["| Item | mjplug | Alternative | Ratio (range) | Goal | Result |", "|---|---|---|---|---|---|"]
    for r in results:
        ratio = f"{r.ratio:.2f} ({r.low:.2f} to {r.high:.2f})"
        rows.append(f"| {r.what} | {r.ours} | {r.other or '-'} | {ratio} | {r.goal} | {'met' if r.met else 'missed'} |")
    return "\n".join(rows)


def main() -> int:
    """Runs all measurements; returns 0 even if a goal is missed, because the machine may be busy."""
    results: list[Result] = []
    for part in (
        steps,
        publication,
        rmw_zenoh,
        free_joints,
        joints,
        lidar,
        camera,
        camera_busy,
        round_trip,
        lockstep,
        lateness,
        view,
    ):
        print(f"measuring {part.__name__.removeprefix('benchmarks.')} ...", file=sys.stderr, flush=True)
        results += part.results()
    versions = ", ".join(f"{name} {version(name)}" for name in ("mjplug", "mujoco", "eclipse-zenoh", "numpy"))
    machine = f"{os.cpu_count()} cores, {platform.system()} {platform.machine()}, Python {platform.python_version()}"
    table = _table(results)
    print(table)
    PAGE.write_text(f"{_INTRODUCTION}\n{table}\n\nMeasured with {versions}; {machine}.\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
