"""Failing works and worker processes: log lines, lost tasks, and recovery."""

import logging
import os
import select
import signal
import socket

import pytest
from waits import TIMEOUT
from worker import works

from mjplug.worker import supervisor as module


@pytest.fixture
def error_messages(caplog):
    """The texts of what was logged at a level or above, by this worker."""
    caplog.set_level(logging.DEBUG)

    def texts(level=logging.ERROR):
        return [
            record.getMessage()
            for record in caplog.records
            if record.levelno >= level and record.name == "mjplug.instance.teller"
        ]

    return texts


def test_a_killed_process_is_started_again_and_what_waited_is_made(server, error_messages):
    told = server.order(works.Dies()).wait_for_ready()
    _, first = told.perform("live")
    told.submit(["die"])
    server.step()
    told.submit(["live"])
    told.wait_for_ready(2)
    told.wait(lambda: len(told.done) == 2)
    job, second = told.done[-1]
    assert second != first
    assert (job.time_ns, job.tasks) == (2_000_000, {"live"})
    assert told.lost == [({"die"}, "the process was killed by SIGKILL")]
    assert error_messages() == [
        "the worker process failed: the process was killed by SIGKILL; it is restarted in 0.5 s"
    ]
    assert (told.status.state, told.status.reason, told.status.restarts) == ("running", "", 1)


def test_an_idle_process_that_is_killed_comes_back_too(server):
    told = server.order(works.Raises()).wait_for_ready()
    _, pid = told.perform("good")
    os.kill(pid, signal.SIGKILL)
    told.wait_for_ready(2)
    assert told.perform("good")[1] != pid
    assert told.lost == []


def test_a_work_that_fails_is_reported_and_is_restarted(server, error_messages):
    told = server.order(works.Raises()).wait_for_ready()
    _, pid = told.perform("good")
    told.submit(["bad", "other"])
    told.wait(lambda: told.lost)
    assert told.lost == [({"bad", "other"}, "a job failed: ValueError('a bad task')")]
    trace, note = error_messages()
    assert trace.startswith("performing bad, other failed\n    Traceback")
    assert trace.endswith("ValueError: a bad task")
    assert note == "the worker process failed: a job failed: ValueError('a bad task'); it is restarted in 0.5 s"
    told.wait_for_ready(2)
    assert told.perform("good")[1] != pid


def test_a_report_that_cannot_be_sent_is_a_failure(server):
    told = server.order(works.ReturnsTheUnspeakable()).wait_for_ready()
    told.submit(["a"])
    told.wait(lambda: told.lost)
    ((tasks, reason),) = told.lost
    assert tasks == {"a"}
    assert reason.startswith("a job failed: ")


def test_a_report_that_cannot_be_read_is_a_failure_too(server):
    told = server.order(works.ReturnsTheUnreadable()).wait_for_ready()
    _, pid = told.perform("good")
    told.submit(["bad"])
    told.wait(lambda: told.lost)
    ((tasks, reason),) = told.lost
    assert tasks == {"bad"}
    assert reason.startswith("a message of the process cannot be unpickled: TypeError")
    told.wait_for_ready(2)
    assert told.perform("good")[1] != pid


def test_a_process_that_is_killed_while_it_opens_is_started_again_in_the_same_environment(server, tmp_path):
    work = works.DiesOpening(tmp_path / "opened")
    told = server.order(work, environments=({"WORKS_IN": "here"}, {"WORKS_IN": "vain"}))
    told.submit(["a"])
    told.wait(lambda: told.lost)
    assert told.lost == [({"a"}, "the process was killed by SIGKILL")]
    told.wait_for_ready()
    assert (told.ready, told.status.restarts) == (["here"], 1)


def test_an_environment_in_which_the_work_crashes_is_not_available(server):
    told = server.order(works.CrashesOpening(), environments=({}, {"WORKS_IN": "here"})).wait_for_ready()
    assert (told.ready, told.status.restarts) == (["here"], 0)


def test_a_process_that_cannot_be_started_now_is_started_later(server, monkeypatch):
    start, failures = module.WorkerProcess, [BlockingIOError(11, "Resource temporarily unavailable")]

    def starts_at_last(*arguments):
        if failures:
            raise failures.pop()
        return start(*arguments)

    monkeypatch.setattr(module, "WorkerProcess", starts_at_last)
    told = server.order(works.Tells()).wait_for_ready()
    assert told.status.restarts == 1


def test_nothing_is_written_to_a_file_that_has_the_number_of_a_closed_pipe(server, monkeypatch):
    told = server.order(works.Dies()).wait_for_ready()
    _, pid = told.perform("live")
    end, taken = module.WorkerProcess.end, []

    def end_and_submit(process):
        how = end(process)
        if not taken:
            taken.extend(one for _ in range(8) for one in socket.socketpair())
            told.submit(["late"])
        return how

    monkeypatch.setattr(module.WorkerProcess, "end", end_and_submit)
    os.kill(pid, signal.SIGKILL)
    told.wait(lambda: len(told.done) == 2)
    assert told.done[-1][0].tasks == {"late"}
    readable, _, _ = select.select(taken, [], [], 0.0)
    for one in taken:
        one.close()
    assert readable == []


def test_environments_are_tried_in_order_until_one_will_do(server, monkeypatch, error_messages):
    monkeypatch.setenv("TAKEN_AWAY", "no")
    told = server.order(
        works.Picky(),
        environments=({"WORKS_IN": "nowhere"}, {"WORKS_IN": "here", "TAKEN_AWAY": ""}, {"WORKS_IN": "vain"}),
    )
    told.wait_for_ready()
    assert told.ready == ["here None"]
    assert error_messages(logging.DEBUG) == ["not available: WORKS_IN=nowhere: WORKS_IN is nowhere"]
    assert told.status.restarts == 0


def test_a_work_that_no_environment_will_do_for_is_unavailable(server, error_messages):
    told = server.order(works.Picky(), environments=({"WORKS_IN": "nowhere"}, {"MUJOCO_GL": "disable"}))
    told.submit(["a"])
    told.wait(lambda: told.lost)
    why = "WORKS_IN=nowhere: WORKS_IN is nowhere; MUJOCO_GL=disable: WORKS_IN is None"
    assert told.lost == [({"a"}, why)]
    assert (told.status.state, told.status.reason) == ("unavailable", why)
    assert error_messages(logging.WARNING) == [
        f"the work is unavailable on this machine: {why}; the server continues without it"
    ]
    told.submit(["b"])
    told.wait(lambda: len(told.lost) == 2)
    assert told.lost[1] == ({"b"}, why)


def test_an_environment_in_which_mujoco_cannot_be_imported_is_not_available(server):
    told = server.order(works.Tells(), environments=({"MUJOCO_GL": "crayons"}, {"MUJOCO_GL": ""})).wait_for_ready()
    assert told.status.state == "running"
    told = server.order(works.Tells(), environments=({"MUJOCO_GL": "crayons"},))
    told.wait(lambda: told.lost)
    assert told.status.reason.startswith("MuJoCo cannot be imported with MUJOCO_GL=crayons: RuntimeError")


def test_a_lockstep_with_an_unavailable_work_continues(server):
    told = server.order(works.CrashesOnOpening(), sync=True)
    for _ in range(3):
        told.submit_in_lockstep("a")
    told.wait(lambda: len(told.lost) == 3)
    reason = "opening the work failed: RuntimeError('no such thing')"
    assert told.lost == [({"a"}, reason)] * 3


def test_a_lockstep_survives_a_process_that_dies(server):
    told = server.order(works.Dies(), sync=True)
    for task in ("live", "die", "live"):
        server.step()
        told.submit_in_lockstep(task)
    assert [job.time_ns for job, _ in told.done] == [2_000_000, 6_000_000]
    assert told.lost == [({"die"}, "the process was killed by SIGKILL")]


def test_submitting_in_lockstep_does_not_wait(server, tmp_path):
    gate = tmp_path / "gate"
    os.mkfifo(gate)
    told = server.order(works.Waits(gate), sync=True).wait_for_ready()
    told.submit(["a"])
    assert told.held
    assert told.done == []
    gate.open("w").close()
    told.wait(lambda: not told.held)
    assert [job.tasks for job, _ in told.done] == [{"a"}]


def ended(pid, within):
    """Whether a process ends; one that was killed still needs a processor for it."""
    try:
        process = os.pidfd_open(pid)
    except ProcessLookupError:
        return True
    try:
        return bool(select.select([process], [], [], within)[0])
    finally:
        os.close(process)


def test_what_a_work_has_started_does_not_keep_the_server_from_ending(server):
    told = server.order(works.Forks()).wait_for_ready()
    _, forked = told.perform("a")
    # Otherwise, this would wait for ever.
    server.workers.close()
    assert ended(forked, within=TIMEOUT)


def test_a_work_that_opened_once_is_tried_again_and_again(server, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "RESTART_DELAYS", (0.01, 0.02))
    told = server.order(works.DiesLater(tmp_path / "opened")).wait_for_ready()
    told.submit(["a"])
    told.wait(lambda: told.lost)
    told.submit(["b"])
    told.wait(lambda: len(told.lost) == 2)
    assert told.lost[0] == ({"a"}, "the process exited with code 7")
    tasks, reason = told.lost[1]
    assert (tasks, told.status.state) == ({"b"}, "restarting")
    assert reason.startswith("opening the work failed: FileExistsError")
    os.unlink(tmp_path / "opened")
    told.wait_for_ready(2)
    assert told.status.restarts >= 2


def test_closing_ends_a_process_that_is_busy(server, tmp_path):
    gate = tmp_path / "gate"
    os.mkfifo(gate)
    told = server.order(works.Waits(gate)).wait_for_ready()
    told.submit(["a"])
    # Otherwise, this would wait for ever.
    server.workers.close()
    assert told.lost == []


def test_closing_ends_a_process_that_is_starting(server):
    told = server.order(works.Tells())
    server.workers.close()
    assert (told.ready, told.status.state) == ([], "starting")
