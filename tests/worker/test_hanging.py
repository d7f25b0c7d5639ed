"""Processes that hang: they are noticed, ended and replaced, and what they had to do is answered."""

import logging
import os
import signal
import subprocess
import sys
import threading
import time

import pytest
from worker import works

from mjplug.worker import hang_detector as module
from mjplug.worker.hang_detector import CHECK_INTERVAL, HangDetector, runnable, usage

SHORT_TIMEOUT = 2.0
"""Replaces the timeouts of the server, which are longer [s]; a worker process sends a heartbeat every second."""


@pytest.fixture
def gate(tmp_path):
    os.mkfifo(tmp_path / "gate")
    return tmp_path / "gate"


@pytest.fixture
def noted(caplog):
    caplog.set_level(logging.ERROR)
    return lambda: [record.getMessage() for record in caplog.records if record.name == "mjplug.instance.teller"]


@pytest.mark.slow
@pytest.mark.parametrize("sync", [False, True])
def test_a_process_that_is_stopped_is_replaced(server, monkeypatch, noted, sync):
    monkeypatch.setattr(module, "SILENCE_TIMEOUT", SHORT_TIMEOUT)
    told = server.order(works.Dies(), sync=sync).wait_for_ready()
    _, stopped = told.perform("live")
    os.kill(stopped, signal.SIGSTOP)
    told.submit(["a"])
    told.wait(lambda: told.lost)
    assert told.lost == [({"a"}, "the process sent no message for 2 s")]
    assert noted() == ["the worker process failed: the process sent no message for 2 s; it is restarted in 0.5 s"]
    told.wait(lambda: not told.held)
    told.wait_for_ready(2)
    assert told.perform("live")[1] != stopped
    assert told.status.restarts == 1


@pytest.mark.slow
def test_a_process_that_is_stopped_while_nothing_is_to_do_is_replaced_too(server, monkeypatch):
    monkeypatch.setattr(module, "SILENCE_TIMEOUT", SHORT_TIMEOUT)
    told = server.order(works.Dies()).wait_for_ready()
    os.kill(told.perform("live")[1], signal.SIGSTOP)
    told.wait_for_ready(2)
    assert told.lost == []


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux lets a pipe grow")
def test_a_job_of_thousands_of_tasks_for_a_stopped_process_does_not_block_physics(server, monkeypatch):
    """As many requests for images as a server keeps open, with long names, wait for one process."""
    monkeypatch.setattr(module, "SILENCE_TIMEOUT", 1000.0)
    told = server.order(works.Dies()).wait_for_ready()
    _, stopped = told.perform("live")
    os.kill(stopped, signal.SIGSTOP)
    tasks = [f"trigger {number} {'camera' * 10}" for number in range(4096)]
    physics = threading.Thread(target=told.submit, args=(tasks,), daemon=True)
    physics.start()
    physics.join(30.0)
    blocked = physics.is_alive()
    os.kill(stopped, signal.SIGKILL)
    assert not blocked


@pytest.mark.slow
def test_a_job_that_never_ends_is_given_up(server, gate):
    told = server.order(works.Waits(gate), job_timeout=1.0).wait_for_ready()
    told.submit(["a"])
    told.wait(lambda: told.lost)
    assert told.lost == [({"a"}, "a job took longer than 1 s (job_timeout)")]
    told.wait_for_ready(2)
    told.submit(["b"])
    gate.open("w").close()
    told.wait(lambda: told.done)
    assert told.done[0][0].tasks == {"b"}


@pytest.mark.slow
def test_an_environment_in_which_opening_never_ends_is_not_available(server, gate, monkeypatch):
    monkeypatch.setattr(module, "OPEN_TIMEOUT", 1.0)
    told = server.order(
        works.OpensLate(gate), environments=({"WORKS_IN": "vain"}, {"WORKS_IN": "here"}), job_timeout=1.0
    ).wait_for_ready()
    assert (told.ready, told.status.restarts) == (["here"], 0)


def test_closing_ends_a_process_that_is_stopped(server):
    told = server.order(works.Dies()).wait_for_ready()
    os.kill(told.perform("live")[1], signal.SIGSTOP)
    # Otherwise, this would wait for ever.
    server.workers.close()


class Used:
    """Replaces the system's figures of a process: processor time, and time waiting for a processor."""

    def __init__(self, monkeypatch):
        self.computed = self.waited = 0.0
        self.runnable = False
        monkeypatch.setattr(module, "usage", lambda pid: (self.computed, self.waited))
        monkeypatch.setattr(module, "runnable", lambda pid: self.runnable)


@pytest.fixture
def used(monkeypatch):
    return Used(monkeypatch)


def looks(watch, seconds, subject, opening=False, each=lambda: None):
    """Looks every second; returns after how many of them the process had to be ended, and why."""
    for second in range(seconds):
        reason = watch.check(float(second), subject, opening)
        if reason:
            return second, reason
        each()
    return None


def test_a_process_that_sends_nothing_hangs(used):
    assert looks(HangDetector(1, 60.0), 100, None) == (10, "the process sent no message for 10 s")


def test_a_process_that_sends_watchdog_messages_does_not(used):
    watch = HangDetector(1, 60.0)
    assert looks(watch, 100, None, each=watch.message_received) is None


def test_a_silent_process_that_computes_or_waits_for_a_processor_does_not_hang_until_its_job_takes_too_long(used):
    def compute():
        used.computed += 1.0

    def starve():
        used.waited += 1.0

    assert looks(HangDetector(1, 60.0), 1000, "job", each=compute) == (60, "a job took longer than 60 s (job_timeout)")
    # A tenth of the wall time counts in any case.
    assert looks(HangDetector(1, 5.95), 1000, "job", each=starve) == (60, "a job took longer than 5.95 s (job_timeout)")
    assert looks(HangDetector(1, 60.0), 1000, None, each=starve) is None


def test_a_process_that_has_waited_for_a_processor_for_long_and_still_waits_does_not_hang(used):
    """The system adds a wait to the sum when it is over."""
    used.runnable = True
    assert looks(HangDetector(1, 60.0), 500, "job") is None
    assert looks(HangDetector(1, 5.95), 1000, "job") == (60, "a job took longer than 5.95 s (job_timeout)")
    assert looks(HangDetector(1, 60.0), 1000, None) is None


def test_each_job_has_its_own_time(used):
    watch = HangDetector(1, 5.0)
    for second in range(0, 100, 4):
        job = object()
        for part in range(4):
            assert watch.check(float(second + part), job, False) == ""
            watch.message_received()


def test_opening_may_take_longer_than_a_job(used):
    watch = HangDetector(1, 5.0)
    assert looks(watch, 1000, "opening", True, watch.message_received) == (
        60,
        "opening the work took longer than 60 s (job_timeout)",
    )
    assert watch.too_long
    watch = HangDetector(1, 90.0)
    assert looks(watch, 1000, "opening", True, watch.message_received) == (
        90,
        "opening the work took longer than 90 s (job_timeout)",
    )


def test_time_without_checks_does_not_count(used):
    watch = HangDetector(1, 60.0)
    # As after a night in which the machine slept.
    for now in (0.0, 30_000.0, 60_000.0):
        assert watch.check(now, "job", False) == ""


def test_the_system_reports_how_long_a_process_computed():
    before = usage(os.getpid())
    if before is None:
        pytest.skip("this system does not tell")
    began = time.process_time()
    while time.process_time() - began < 0.1:
        pass
    after = usage(os.getpid())
    assert after[0] - before[0] == pytest.approx(0.1, abs=0.09)
    assert after[1] >= before[1]
    assert usage(2**22 + 1) is None
    assert CHECK_INTERVAL < module.SILENCE_TIMEOUT


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells")
def test_a_thread_that_computes_can_run_and_a_stopped_process_cannot():
    assert runnable(os.getpid())
    child = subprocess.Popen(["sleep", "60"])
    try:
        os.kill(child.pid, signal.SIGSTOP)
        os.waitid(os.P_PID, child.pid, os.WSTOPPED | os.WNOWAIT)
        assert not runnable(child.pid)
    finally:
        child.kill()
        child.wait()
    assert not runnable(2**22 + 1)
