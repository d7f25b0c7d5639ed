import ctypes
import os

import mujoco
import pytest
from conftest import ARM

from mjplug.log_scope import LogScope
from mjplug.physics import process
from mjplug.physics.simulation import Simulation


def refuse_none(name=None, **options):
    if name is None:
        raise TypeError("bad argument type for built-in operation")
    raise OSError(f"no library {name}")


@pytest.fixture
def _windows(monkeypatch):
    """What Windows lacks: a handle of the process itself, process priorities as on POSIX, and /proc."""
    monkeypatch.setattr(ctypes, "CDLL", refuse_none)
    monkeypatch.delattr(os, "getpriority")
    monkeypatch.setattr(process.sys, "platform", "win32")


@pytest.mark.usefixtures("_windows")
def test_where_the_platform_lacks_a_measure_the_server_continues_without_it():
    assert process.prefer_this_thread() == {"scheduler slice": False, "timer slack": False}
    assert process.clear_timer_callback() is False


@pytest.fixture
def _mujoco_tamed():
    with process.mujoco_configured(), LogScope().active():
        yield


@pytest.mark.usefixtures("_mujoco_tamed")
def test_a_warning_of_mujoco_that_repeats_does_not_fill_the_log(monkeypatch, caplog):
    """MuJoCo warns after each divergence, and a client can cause any number of divergences."""
    now = [0.0]
    monkeypatch.setattr(process, "monotonic", lambda: now[0])
    simulation = Simulation(mujoco.MjModel.from_xml_string(ARM))

    def diverge():
        simulation.checkpoint()
        simulation.data.qvel[0] = float("nan")
        assert simulation.advance(1) is not None
        simulation.data.qvel[0] = 0.0
        simulation.checkpoint()
        assert simulation.advance(1) is None

    def lines(kind):
        return [record.getMessage() for record in caplog.records if f"huge value in {kind}" in record.getMessage()]

    for _ in range(20):
        diverge()
    assert [len(lines(kind)) for kind in ("QVEL", "QACC")] == [1, 1]
    assert "MuJoCo: Nan, Inf or huge value in QVEL at DOF 0" in lines("QVEL")[0]
    now[0] = process.WARNING_INTERVAL
    diverge()
    assert lines("QVEL")[1].endswith("(19 more since the last line)")
