"""Every way to stop a server: it answers waiting calls, logs the stop, and exits."""

import signal
import subprocess

import pytest
import warm_python
from cli.client import wrench, wrenches
from cli.process import COMMAND, FREE_PORT, STOPPING, environment

LONG = wrenches(wrench("box", force=(1.0, 0.0, 0.0), seconds=1000.0))


@pytest.mark.parametrize(("number", "state"), [("SIGINT", "--speed=1"), ("SIGTERM", "--paused")])
def test_a_signal_ends_the_server_and_answers_waiting_calls(serve, connect, number, state):
    server = serve("bundled:box", "--plugin", "external_wrench", state)
    client = connect(server)
    push = client.request("external_wrench/apply_wrench", **LONG)
    # Answered after the push has been taken, since both come over one connection.
    client.do("mjplug/set_free_joint_state")
    assert not push.answered
    assert server.stop(signal.Signals[number]) == 0
    assert push.answer().json == {"success": False, "message": "cancelled: the server is stopping"}
    assert "stopped at t = " in server.err.text
    assert "Traceback" not in server.err.text


def test_a_signal_that_follows_the_ready_line_at_once_is_not_too_early(tmp_path):
    words = ("serve", "bundled:box", *FREE_PORT)
    servers = [
        warm_python.popen(COMMAND, words, cwd=tmp_path, env=environment(), stdout=subprocess.PIPE) for _ in range(3)
    ]
    try:
        for server in servers:
            assert server.stdout.readline().startswith("ready")
            server.send_signal(signal.SIGTERM)
        assert [server.wait(STOPPING) for server in servers] == [0, 0, 0]
    finally:
        for server in servers:
            server.kill()
            server.communicate()


def test_the_end_of_the_duration_answers_waiting_calls(serve, connect):
    server = serve("bundled:box", "--plugin", "external_wrench", "--paused", "--duration", "1")
    client = connect(server)
    push = client.request("external_wrench/apply_wrench", **LONG)
    client.do("mjplug/step_simulation", steps=499)
    assert not push.answered
    client.do("mjplug/step_simulation", steps=1)
    assert server.end() == 0
    assert push.answer().json == {"success": False, "message": "cancelled: the server is stopping"}
    assert "stopped at t = 1.000 s, after 500 steps" in server.err.text
