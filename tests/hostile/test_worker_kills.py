"""A few workers are killed and stopped under load; `python -m hostile.worker_kills` does it for longer."""

from pathlib import Path

import pytest
from camera_scenes import gl  # noqa: F401 - a fixture
from hostile import worker_kills

pytestmark = pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="looks for processes in /proc")


@pytest.mark.slow
@pytest.mark.usefixtures("gl")
@pytest.mark.timeout(600)
def test_killed_and_stopped_workers_do_not_affect_others():
    run = worker_kills.attack(count=3, seed=3, seconds=300.0, hang=0.34, busy=0)
    assert run.findings == []
    assert run.counts["SIGKILL"] + run.counts["SIGSTOP"] == 3
    assert run.counts["published"] > 0
