"""Signals to other programs that a server is ready, healthy or stopping."""

import json
import os
import signal
import socket
import subprocess
import sys
import threading

import pytest
from cli.conftest import WORLD
from cli.process import COMMAND, FREE_PORT, STARTING, STOPPING, environment, run
from waits import until

from mjplug.lifecycle.ready_file import ReadyFile
from mjplug.lifecycle.systemd import ServiceManager
from mjplug.physics.inbox import Inbox


class Manager:
    """The socket of a service manager."""

    def __init__(self, path):
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(path)
        self.socket.settimeout(STARTING)
        self.environ = {"NOTIFY_SOCKET": path.replace("\0", "@")}

    def next(self):
        return self.socket.recv(4096).decode()

    def until(self, message):
        """Returns the messages before one."""
        before = []
        while (got := self.next()) != message:
            before.append(got)
        return before


@pytest.fixture(params=["a file", "an abstract name"])
def manager(request, tmp_path):
    # The path of a socket has at most 107 bytes.
    address = str(tmp_path / "notify") if request.param == "a file" else f"\0mjplug-test-{os.getpid()}"
    manager = Manager(address[:107])
    yield manager
    manager.socket.close()


def test_a_service_manager_gets_readiness_watchdog_and_stop_messages(serve, manager):
    server = serve("bundled:box", env=manager.environ | {"WATCHDOG_USEC": "200000"})
    ready = manager.next()
    assert ready.startswith(f"READY=1\nSTATUS={server.endpoint} · model box (1 body, ")
    assert [manager.next() for _ in range(3)] == ["WATCHDOG=1"] * 3
    assert server.stop() == 0
    assert set(manager.until("STOPPING=1\nSTATUS=stopping")) <= {"WATCHDOG=1"}


def test_a_paused_server_is_alive_and_one_that_hangs_is_not(serve, connect, tmp_path):
    manager = Manager(str(tmp_path / "notify"))
    server = serve(
        "scene.xml", "--plugin", "hanging:Serving:culprit", "--paused",
        cwd=WORLD, env=manager.environ | {"WATCHDOG_USEC": "200000"},
    )  # fmt: skip
    assert manager.next().startswith("READY=1")
    assert [manager.next() for _ in range(3)] == ["WATCHDOG=1"] * 3
    connect(server).request("culprit/hang")
    server.err.wait_for("hanging", STARTING)
    manager.socket.settimeout(1.0)
    # One may have been on its way when the hang began.
    with pytest.raises(TimeoutError):
        manager.until("nothing like this")
    manager.socket.close()


@pytest.mark.parametrize("pid", ["", "1"])
def test_watchdog_messages_are_sent_only_if_requested_for_this_process(tmp_path, pid):
    manager = Manager(str(tmp_path / "notify"))
    environ = {**manager.environ, "WATCHDOG_USEC": "20000", "WATCHDOG_PID": pid, "OTHER": "stays"}
    told = ServiceManager(environ)
    assert environ == {"OTHER": "stays"}
    inbox = Inbox()
    told.ready("well", inbox)
    assert manager.next() == "READY=1\nSTATUS=well"
    if pid:
        assert not [thread for thread in threading.enumerate() if thread.name == "service manager"]
    else:
        # Nothing until the physics thread has run a call.
        manager.socket.settimeout(0.2)
        with pytest.raises(TimeoutError):
            manager.next()
        manager.socket.settimeout(STARTING)
        inbox.wait(STARTING)
        assert manager.next() == "WATCHDOG=1"
    told.stopping()
    assert manager.until("STOPPING=1\nSTATUS=stopping") in ([], ["WATCHDOG=1"])
    manager.socket.close()


def test_without_a_service_manager_nothing_is_sent_and_one_that_is_gone_gets_a_warning(tmp_path, caplog):
    ServiceManager({}).stopping()
    assert caplog.text == ""
    ServiceManager({"NOTIFY_SOCKET": str(tmp_path / "gone")}).stopping()
    assert f"cannot notify the service manager at NOTIFY_SOCKET={tmp_path}/gone" in caplog.text


def test_the_ready_file_is_there_while_the_server_is_ready(serve, tmp_path):
    path = tmp_path / "ready.json"
    path.write_text("from an earlier server")
    server = serve("bundled:box", "--paused", "--ready-file", str(path), "--set", "namespace=robot1")
    until(path.exists)
    assert json.loads(path.read_text()) == {
        "endpoint": server.endpoint, "server": "/robot1/mjplug", "pid": server.process.pid,
    }  # fmt: skip
    assert [entry.name for entry in tmp_path.iterdir()] == ["ready.json"]
    assert server.stop() == 0
    assert not path.exists()


def test_a_stale_ready_file_is_gone_before_the_server_is_ready(tmp_path):
    path = tmp_path / "ready.json"
    path.write_text("from an earlier server")
    file = ReadyFile(path)
    assert list(tmp_path.iterdir()) == []
    file.write("tcp/127.0.0.1:1", "/mjplug")
    other = json.dumps({"endpoint": "tcp/127.0.0.1:2", "server": "/mjplug", "pid": os.getpid() + 1})
    path.write_text(other)
    file.remove()
    assert path.read_text() == other


@pytest.mark.parametrize(("where", "reason"), [("nowhere/r.json", "No such file or directory"), (".", "")])
def test_a_ready_file_that_cannot_be_written_stops_the_start(cli, where, reason, tmp_path):
    done = cli("serve", "bundled:box", "--ready-file", str(tmp_path / where), *FREE_PORT)
    assert (done.returncode, done.stdout) == (1, "")
    assert f"error: cannot write the ready file {tmp_path / where}: {reason}" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_client_that_connects_on_the_ready_line_is_answered(serve, connect):
    client = connect(serve("bundled:box", "--speed", "max"))
    assert client.ask("mjplug/get_parameters", names=["model"])["values"][0]["string_value"] == "bundled:box"


def test_a_signal_before_the_first_step_ends_the_server(tmp_path):
    command = [*COMMAND, "serve", "bundled:box", *FREE_PORT, "--speed", "max"]
    server = subprocess.Popen(command, cwd=tmp_path, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert server.stdout.readline().startswith(b"ready")
    server.send_signal(signal.SIGINT)
    _, text = server.communicate(timeout=STOPPING)
    assert server.returncode == 0
    assert b"stopped at t = " in text


def test_the_quick_check_says_that_a_server_is_healthy_and_imports_nothing_that_takes_long(serve, cli):
    server = serve("bundled:box", "--paused")
    command = [sys.executable, "-X", "importtime", "-m", "mjplug"]
    checked = cli("doctor", "--quick", "-e", server.endpoint, command=command)
    assert checked.returncode == 0
    assert checked.stdout.startswith("healthy: /mjplug answered after ")
    assert checked.stdout.endswith(" ms, at t = 0.000 s\n")
    imported = {line.rpartition("|")[2].strip() for line in checked.stderr.splitlines()}
    assert "zenoh" in imported
    # Pydantic is: typer needs it.
    assert not imported & {"mujoco", "numpy", "cv2", "yaml", "mjplug.client", "mjplug_schemas.message"}


def test_the_quick_check_distinguishes_a_missing_server_from_one_that_hangs_or_reports_errors(serve, connect, tmp_path):
    nobody = run("doctor", "--quick", "-e", "tcp/127.0.0.1:9", cwd=tmp_path)
    assert nobody.returncode == 5
    assert nobody.stderr.startswith("error: connection refused by tcp/127.0.0.1:9: ")
    server = serve(
        "scene.xml", "--plugin", "faulty:Unwell:culprit", "--plugin", "hanging:Serving:hanging", "--paused",
        cwd=WORLD,
    )  # fmt: skip
    client = connect(server)
    sick = run("doctor", "--quick", "-e", server.endpoint, cwd=tmp_path)
    assert (sick.returncode, sick.stdout) == (1, "")
    assert sick.stderr == "unhealthy: /mjplug reports mjplug: culprit: no oil\n"
    client.request("hanging/hang")
    server.err.wait_for("hanging", STARTING)
    hung = run("doctor", "--quick", "-e", server.endpoint, "--timeout", "0.5", cwd=tmp_path)
    assert (hung.returncode, hung.stdout) == (6, "")
    assert hung.stderr.startswith("error: ")
    assert hung.stderr.count("\n") == 1


def test_a_program_that_matches_every_key_and_never_answers_makes_no_server_look_unready(serve, connect, cli):
    first = serve("bundled:box", "--set", "node_name=first")
    asked, unanswered = [], []

    def keep(query):
        asked.append(str(query.key_expr))
        unanswered.append(query)

    silent = connect(first).session.declare_queryable("**", keep)
    second = serve("bundled:box", "--set", "node_name=second", listen=("--connect", first.endpoint))
    assert "second/get_parameters" not in asked
    done = cli("doctor", "--quick", "--server", "/second", "-e", second.endpoint)
    assert (done.returncode, done.stderr) == (0, "")
    assert "second/get_diagnostics" in asked
    silent.undeclare()
    for query in unanswered:
        query.drop()
