"""Every example runs as its first lines say, in a process of its own, and prints what it promises."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
NAMES = sorted(path.parent.name for path in EXAMPLES.glob("*/run.py"))


def run(name, cwd):
    environment = {key: value for key, value in os.environ.items() if not key.startswith("MJPLUG_")}
    return subprocess.run(
        [sys.executable, EXAMPLES / name / "run.py"],
        cwd=cwd, env=environment, capture_output=True, text=True, timeout=50, check=False,
    )  # fmt: skip


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """Runs each example once, from another folder than its own."""
    results = {}

    def ran(name):
        if name not in results:
            results[name] = run(name, tmp_path_factory.mktemp("elsewhere"))
        return results[name]

    return ran


def test_there_are_examples():
    assert NAMES


@pytest.mark.parametrize("name", NAMES)
def test_an_example_runs_to_its_end(ran, name):
    done = ran(name)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    assert "ready · tcp/127.0.0.1:" in done.stdout


def test_the_box_is_pushed_as_far_as_newton_says(ran):
    printed = ran("00_push_a_box").stdout
    assert re.search(r"^heartbeat: MuJoCo ROS2 Control Heartbeat #0 \| Simulation time: 1\.000000s$", printed, re.M)
    assert "answer: {'success': True, 'message': 'applied 1 wrench, the longest for 2 s'}" in printed
    x, y, z = map(float, re.search(r"moved by x (\S+) m, y (\S+) m, z (\S+) m", printed).groups())
    # 10 N on 2 kg for 1.5 s, then half a second in which the force falls linearly to nothing.
    acceleration, steady, ramp = 10.0 / 2.0, 1.5, 0.5
    speed = acceleration * steady
    distance = acceleration * steady**2 / 2 + speed * ramp + acceleration * ramp**2 / 3
    # The last pose seen may be 20 ms older than the end of the push, and a little newer.
    final_speed = speed + acceleration * ramp / 2
    assert distance - 0.025 * final_speed < x < distance + 0.025 * final_speed
    assert (y, z) == (0.0, 0.0)
