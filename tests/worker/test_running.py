"""Works in processes: what they are given, what they publish, what comes back."""

import contextlib
import gc
import json
import logging
import os
import threading
import time
from pathlib import Path
from queue import Empty

import mujoco
import numpy as np
import pytest
from waits import TIMEOUT, until
from wire.conftest import Client
from worker import works
from worker.conftest import Ordered

from mjplug.contracts.transport import DEFAULT, LATCHED
from mjplug.errors import PluginError
from mjplug.wire.rmw_zenoh.attachment import Attachment
from mjplug.wire.rmw_zenoh.tokens import gid
from mjplug_schemas.sensor_msgs import JointState

ROS_KEY = "0/told/sensor_msgs::msg::dds_::JointState_/*"


def expected(simulation):
    """Positions, and poses that belong to them, by MuJoCo itself."""
    data = mujoco.MjData(simulation.model)
    data.qpos[:] = simulation.data.qpos
    mujoco.mj_kinematics(simulation.model, data)
    return data.qpos.tolist(), data.xpos.ravel().tolist()


def children():
    """The ids of this process's children, zombies too."""
    found = []
    for task in Path("/proc/self/task").iterdir():
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):
            found += (task / "children").read_text().split()
    return {int(pid) for pid in found}


def open_files():
    """What pipes and shared memory this process has open."""
    targets = []
    for link in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(FileNotFoundError):
            targets.append(os.readlink(link))
    return sorted(target for target in targets if target.startswith(("pipe:", "/memfd:")))


def test_a_state_becomes_a_message_on_every_key_of_the_topic(server, client):
    plain, text, ros = client.listen("told"), client.listen("told/@json"), client.listen(ROS_KEY)
    client.settle()
    told = server.order(works.Tells()).wait_for_ready()
    server.step(25)
    job, (qpos, matched) = told.perform("b", "a")
    assert matched
    assert (job.time_ns, job.epoch, job.tasks) == (50_000_000, 0, {"a", "b"})
    assert qpos == server.simulation.data.qpos.tolist()

    sample = plain.get(timeout=TIMEOUT)
    message = JointState.from_cdr(bytes(sample.payload))
    assert str(sample.encoding) == "application/cdr;sensor_msgs/msg/JointState"
    position, poses = expected(server.simulation)
    assert (list(message.position), list(message.velocity)) == (position, poses)
    assert message.header.stamp.nanosec == 50_000_000
    assert list(message.effort) == [server.simulation.data.time]
    assert json.loads(bytes(text.get(timeout=TIMEOUT).payload))["name"] == ["a", "b"]

    sample = ros.get(timeout=TIMEOUT)
    assert bytes(sample.payload) == message.to_cdr()
    (token,) = client.session.liveliness().get("@ros2_lv/0/*/*/*/MP/*/*/*/%told/**", timeout=TIMEOUT)
    attachment = Attachment.from_bytes(bytes(sample.attachment))
    assert attachment.gid == gid(str(token.ok.key_expr))
    assert attachment.sequence_number == 1


def test_a_server_that_is_a_client_itself_has_its_processes_on_the_same_network(guest, client):
    samples = client.listen("told")
    client.settle()
    guest.order(works.Tells()).wait_for_ready().perform("a")
    assert JointState.from_cdr(bytes(samples.get(timeout=TIMEOUT).payload)).name == ("a",)


def test_subscribers_can_start_and_stop_at_any_time(server, client):
    told = server.order(works.Tells()).wait_for_ready()
    for n in range(5):
        samples = client.listen("told")
        client.settle()
        server.step()
        # On a busy machine, the worker process may miss the first messages before it sees the subscriber, and the last
        # message of the round before may come late.
        names, until = [], time.monotonic() + TIMEOUT
        while (str(n),) not in names:
            assert time.monotonic() < until, names
            told.perform(str(n))
            with contextlib.suppress(Empty):
                names.append(JointState.from_cdr(bytes(samples.get(timeout=0.1).payload)).name)
        assert set(names) <= {(str(n - 1),), (str(n),)}
        client._kept.pop().undeclare()
        until = time.monotonic() + TIMEOUT
        while told.publisher.matched and time.monotonic() < until:
            client.call("mjplug/interfaces?subscribed=told")
        assert not told.publisher.matched


def test_a_latched_message_waits_for_those_who_come_later(server, client):
    told = server.order(works.Tells(), LATCHED).wait_for_ready()
    told.perform("a")
    answers = [answer for answer in client.ask("told") if answer.ok]
    assert [JointState.from_cdr(answer.payload).name for answer in answers] == [("a",)]


def test_a_large_message_arrives_whole(server, client):
    samples = client.listen("told")
    client.settle()
    told = server.order(works.Fills(1_000_000)).wait_for_ready()
    for n in range(5):
        told.perform(str(n))
        message = JointState.from_cdr(bytes(samples.get(timeout=TIMEOUT).payload))
        assert message.name == ("x" * 1_000_000, str(n))


def test_a_busy_process_gets_the_newest_state_and_tasks_are_merged(server, tmp_path):
    gate = tmp_path / "gate"
    os.mkfifo(gate)
    told = server.order(works.Waits(gate)).wait_for_ready()
    told.submit(["a"])
    for tasks in (["a"], ["a", "b"], ["c"]):
        server.step()
        told.submit(tasks)
    for n in range(2):
        # Opens when the process is at it.
        gate.open("w").close()
        told.wait(lambda n=n: len(told.done) > n)
    assert [(job.time_ns, set(job.tasks), time) for job, time in told.done] == [
        (0, {"a"}, 0.0),
        (6_000_000, {"a", "b", "c"}, server.simulation.data.time),
    ]
    assert told.status.dropped == {"a": 1}
    assert told.status.performed == 2


def test_in_lockstep_every_step_has_its_message(server, client):
    samples = client.listen("told")
    client.settle()
    told = server.order(works.Tells(), sync=True)
    states = []
    for _ in range(20):
        server.step()
        told.submit_in_lockstep("a")
        states.append((server.simulation.time_ns, server.simulation.data.qpos.tolist()))
    messages = [JointState.from_cdr(bytes(samples.get(timeout=TIMEOUT).payload)) for _ in states]
    assert [(m.header.stamp.sec * 10**9 + m.header.stamp.nanosec, list(m.position)) for m in messages] == states
    assert samples.empty()
    assert [job.time_ns for job, _ in told.done] == [time_ns for time_ns, _ in states]
    assert told.status.dropped == {}


def test_a_subscriber_right_before_an_answered_job_gets_its_message(server):
    told = server.order(works.Tells()).wait_for_ready()
    for number in range(20):
        latecomer = Client(server.network.session.endpoint)
        try:
            samples = latecomer.listen("told")
            # A request on the same link comes after the subscription.
            latecomer.settle()
            before = len(told.done)
            told.submit([f"task {number}"], answered=True)
            told.wait(lambda before=before: len(told.done) > before)
            message = JointState.from_cdr(bytes(samples.get(timeout=TIMEOUT).payload))
            assert list(message.name) == [f"task {number}"]
        finally:
            latecomer.close()


def test_what_is_logged_in_the_process_appears_under_the_instance(server, caplog):
    with caplog.at_level(logging.INFO):
        server.order(works.Logs()).wait_for_ready().perform("rain")
    assert ("mjplug.instance.teller", logging.WARNING, "rain is due") in caplog.record_tuples
    assert ("mjplug.instance.teller", logging.INFO, "by a library") in caplog.record_tuples
    assert not any(record.levelno < logging.INFO for record in caplog.records if record.name.endswith("teller"))


def test_the_process_imports_from_where_the_server_does(server, tmp_path, monkeypatch):
    (tmp_path / "somewhere_else.py").write_text(
        "from mjplug.plugin import Work\n"
        "class Foreign(Work):\n"
        "    def open(self, model, publishers, logger): return f'{model.nq} positions'\n"
        "    def perform(self, data, job): return None\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    import somewhere_else

    assert server.order(somewhere_else.Foreign()).wait_for_ready().ready == [f"{server.simulation.model.nq} positions"]


def test_what_lies_in_the_current_folder_is_not_taken_for_python_s_own(server, tmp_path, monkeypatch):
    (tmp_path / "queue.py").write_text("raise RuntimeError('not this one')")
    monkeypatch.chdir(tmp_path)
    assert server.order(works.Tells()).wait_for_ready().status.state == "running"


def test_a_work_that_cannot_be_sent_is_refused(server):
    work = works.Waits("x")
    work.lock = lambda: None
    with pytest.raises(PluginError, match="teller: the work Waits cannot be pickled: Can't"):
        server.order(work)


def test_several_works_run_at_the_same_time(server):
    gc.collect()
    files, others = open_files(), children()
    first, second = server.order(works.Tells()), server.order(works.Tells())
    for told in (first.wait_for_ready(), second.wait_for_ready()):
        assert told.perform("a")[1][0] == server.simulation.data.qpos.tolist()
    assert first.ready != second.ready
    assert len(children() - others) == 2
    server.workers.close()
    assert children() <= others
    assert not [thread.name for thread in threading.enumerate() if thread.name.startswith("worker ")]
    server.workers.close()
    # Shared memory must exist as long as an array refers to it.
    del first, second, told
    gc.collect()
    assert open_files() == files


def test_the_snapshot_is_the_whole_state(server):
    """Velocities, activations and controls come across too."""
    server.step(10)
    told = server.order(works.Derives()).wait_for_ready()
    _, (qvel, act, ctrl, qacc) = told.perform("a")
    data = mujoco.MjData(server.simulation.model)
    for name in ("qpos", "qvel", "act", "ctrl", "qacc_warmstart"):
        getattr(data, name)[:] = getattr(server.simulation.data, name)
    data.time = server.simulation.data.time
    mujoco.mj_forward(server.simulation.model, data)
    assert (qvel, act, ctrl) == (data.qvel.tolist(), data.act.tolist(), data.ctrl.tolist())
    np.testing.assert_allclose(qacc, data.qacc, rtol=0, atol=1e-9)


def test_a_stopped_worker_ends_its_process_and_another_one_can_start(server):
    ordered = server.order(works.Tells(), save_later=True).wait_for_ready()
    pid = int(ordered.ready[0].removeprefix("process "))
    assert pid in children()
    ordered.worker.stop()
    until(lambda: pid not in children())
    again = Ordered(server, works.Tells(), DEFAULT).wait_for_ready()
    assert again.perform("there")[1][0] == expected(server.simulation)[0]


def test_a_worker_that_is_stopped_before_it_is_ready_ends_too(server):
    before = set(children())
    ordered = server.order(works.Tells(), save_later=True)
    ordered.worker.stop()
    until(lambda: not server.workers.running)
    assert set(children()) == before
