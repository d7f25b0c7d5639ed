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
    spawn,
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

REMARKS = """
## What remains, and why

**A request for one step** (`~/step`) takes 2.0 to 2.4 times as long as a bare query (3.4 before requests were handled
at once), against a goal of 1.35. The difference on the test machine is about 200 µs, of which Python code needs 45 µs
when it is repeated without pauses. After a pause of half a millisecond, the same code takes three to four times as
long, because it is no longer in the caches.
The rest is the hand-over from Zenoh's thread to the physics thread (15 to 30 µs), and waking Zenoh's sending thread on
a processor that sleeps (35 µs in this virtual machine; a bare server replies while that processor is still awake).
Steps are not taken on Zenoh's thread, because plugins may rely on one thread. Several actions in one request share this
time, so they are the way to many steps per second.

**One of 50 steps in a request** costs about 2 µs more than in a loop without mjplug: the state before the step is
saved for the case of a divergence, timers are checked, and the results are copied. The time of the request itself is
divided by 50.

**An active wrench** costs about 8.5 µs of processor time a step on the small model. Repeated without the steps in
between, its parts need 5.8 µs: 1.1 µs for the poses at the beginning of the step, by which the wrench is rotated,
1.3 µs for the rotation, 0.9 µs because `mj_step` is called once for each step, and the rest for saving the state,
calling the plugin and checking what is due. Between two steps, Python code takes longer, because the step has replaced
it in the caches. 0.75 of the speed of C would leave 4.2 µs, which is out of reach in Python for a model of 12 µs.
**A driven base** costs about 7.5 µs a step.

**The states of 100 free bodies** take 16 µs against a goal of 10: 3.5 µs for the poses in MuJoCo, 5 µs to collect and
rotate the velocities, and 4.6 µs to write 1500 numbers between the names in the message. numpy needs about 2 ns for
each number that it writes to an indexed place; views with strides and other orders of the numbers were not faster.

**Saving and restoring a state** takes much longer than `mj_getState` and `mj_setState` (0.4 ms and 0.9 ms of processor
time for the quadruped with two plugins), because it contains the results of the last step, the timers, and the state of
each plugin, it gets a digest, and everything is checked before anything changes.
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
        spawn,
        view,
    ):
        print(f"measuring {part.__name__.removeprefix('benchmarks.')} ...", file=sys.stderr, flush=True)
        results += part.results()
    versions = ", ".join(f"{name} {version(name)}" for name in ("mjplug", "mujoco", "eclipse-zenoh", "numpy"))
    machine = f"{os.cpu_count()} cores, {platform.system()} {platform.machine()}, Python {platform.python_version()}"
    table = _table(results)
    print(table)
    PAGE.write_text(f"{_INTRODUCTION}\n{table}\n\nMeasured with {versions}; {machine}.\n{REMARKS}", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
