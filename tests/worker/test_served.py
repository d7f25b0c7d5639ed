"""`mjplug serve` with a plugin whose work runs in a process: what users see, and that no process is left behind."""

import os
import signal
import sys
import uuid
from pathlib import Path

import mujoco
import pytest
from cli.client import Client
from cli.process import STARTING, Served, run
from waits import until

WORLD = Path(__file__).parent / "world"
OF_A_TERMINAL = (
    sys.executable,
    "-c",
    "import os, sys; os.setsid(); os.execv(sys.executable, [sys.executable, '-m', 'mjplug', *sys.argv[1:]])",
)
"""Starts a server in its own process group, as a shell does."""


@pytest.fixture
def mark():
    """Environment variables that identify the processes of one test."""
    return {"MARK": str(uuid.uuid4()), "MUJOCO_GL": "disable"}


@pytest.fixture
def serve():
    servers = []

    def serve(*arguments, **options):
        servers.append(Served("scene.xml", *arguments, cwd=WORLD, **options))
        return servers[-1]

    yield serve
    for server in servers:
        server.kill()


def workers(mark):
    """The ids of the worker processes of a test."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            command, environment = (folder / "cmdline").read_bytes(), (folder / "environ").read_bytes()
        except OSError:
            continue
        if b"mjplug.worker" in command and mark["MARK"].encode() in environment:
            found.append(int(folder.name))
    return found


def test_a_plugin_of_the_configurations_folder_has_its_work_done_in_a_process(serve, mark):
    server = serve("--paused", "--plugin", "teller:Teller:teller", env=mark)
    with Client(server.endpoint) as client:
        told = client.listen("teller/positions/@json")
        client.do("mjplug/step_simulation", steps=25)
        messages = [told.next() for _ in range(5)]
        client.do("mjplug/reset_world")
        client.do("mjplug/step_simulation", steps=5)
        messages.append(told.next())
    model = mujoco.MjModel.from_xml_path(str(WORLD / "scene.xml"))
    data = mujoco.MjData(model)
    expected = []
    for _ in range(5):
        mujoco.mj_step(model, data, 5)
        expected.append(data.qpos.tolist())
    assert [message["position"] for message in messages] == [*expected, expected[0]]
    assert [message["header"]["stamp"]["nanosec"] for message in messages] == [n * 10_000_000 for n in range(1, 7)]
    assert [message["header"]["frame_id"] for message in messages] == ["0"] * 5 + ["1"]
    # The environment of the worker process overrides the user's variables; the others are kept.
    assert f"teller: worker {workers(mark)[0]}, MUJOCO_GL=disable" in server.err.text
    assert server.stop() == 0
    assert workers(mark) == []
    assert "Traceback" not in server.err.text


def test_ctrl_c_in_a_terminal_ends_everything_in_order(serve, mark):
    server = serve("--plugin", "teller:Teller:teller", env=mark, command=OF_A_TERMINAL)
    server.err.wait_for("teller: worker", STARTING)
    os.killpg(server.process.pid, signal.SIGINT)
    assert server.end() == 0
    assert workers(mark) == []
    assert "Traceback" not in server.err.text
    assert "error" not in server.err.text


def test_a_server_that_is_killed_takes_its_processes_with_it(serve, mark):
    server = serve("--plugin", "teller:Teller:teller", env=mark)
    server.err.wait_for("teller: worker", STARTING)
    assert len(workers(mark)) == 1
    server.process.kill()
    until(lambda: not workers(mark))


def test_a_plugin_that_refuses_leaves_no_process(mark):
    ended = run("serve", "scene.xml", "--plugin", "teller:Quitter:teller", "-l", "tcp/127.0.0.1:0", cwd=WORLD, env=mark)
    assert (ended.returncode, workers(mark)) == (1, [])
    assert ended.stderr == "error: plugin teller refused to start: not today\n"


def test_a_wrong_mujoco_gl_does_not_matter_to_a_work_that_takes_it_away(serve, mark):
    server = serve("--plugin", "teller:Teller:teller", "-s", "plugins.teller.backend=''", env=mark | {"MUJOCO_GL": "x"})
    assert server.err.wait_for(r"teller: worker \d+, (.*)", STARTING)[1] == "MUJOCO_GL=None"
    assert server.stop() == 0
