"""`mjplug action` against a live server."""

import json
import re
import signal
import subprocess
from unittest import mock

import pytest
import warm_python
from cli.process import COMMAND, STARTING, Served, environment
from cli.tour import typed

from mjplug.cli.names import complete_action_type
from mjplug.cli.quick_completion import live_names

ACTION = "/joint_commands/follow_joint_trajectory"
TYPE = "control_msgs/action/FollowJointTrajectory"
GOAL = "{trajectory: {joint_names: [joint1], points: [{positions: [0.2], time_from_start: {sec: %s}}]}}"


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    served = Served("bundled:arm", "--plugin", "joint_commands", "--speed", "20", cwd=tmp_path_factory.mktemp("arm"))
    yield served
    assert served.stop() == 0
    assert "Traceback" not in served.err.text


@pytest.fixture
def ask(server):
    def ask(*words, code=0):
        with mock.patch.dict("os.environ", {"MJPLUG_CONNECT": server.endpoint}):
            done = typed("action", *words)
        assert done.code == code, done
        return done

    return ask


def test_actions_are_listed_and_described(ask):
    names = ask("list").out.splitlines()
    # The server has actions of its own.
    assert ACTION in names
    assert names == sorted(names)
    assert f"{ACTION} [{TYPE}]" in ask("list", "-t").out.splitlines()
    assert ask("list", "--count-actions").out == f"{len(names)}\n"
    listed = next(action for action in json.loads(ask("list", "--json").out) if action["name"] == ACTION)
    assert (listed["name"], listed["key"], len(listed["topics"]), len(listed["services"])) == (ACTION, ACTION[1:], 2, 3)
    assert ask("type", ACTION).out == f"{TYPE}\n"
    assert ask("find", "control_msgs/FollowJointTrajectory").out == f"{ACTION}\n"
    assert ask("find", "control_msgs/GripperCommand").out == ""
    described = f"Action: {ACTION}\nAction clients: 0\nAction servers: 1\n"
    assert ask("info", ACTION).out == f"{described}    /mjplug\n"
    assert ask("info", ACTION, "-t").out == f"{described}    /mjplug [{TYPE}]\n"
    assert ask("info", ACTION, "-c").out == described


def test_a_goal_is_sent_and_its_result_shown(ask):
    out = ask("send_goal", ACTION, TYPE, GOAL % 1).out
    sent, accepted, result, finished = out.split("\n\n")
    assert sent.splitlines()[:2] == ["Sending goal:", "    trajectory:"]
    assert re.fullmatch(r"Goal accepted with ID: [0-9a-f-]{36}", accepted)
    assert result == "Result:\n    error_code: 0\n    error_string: Goal successfully reached!"
    assert finished == "Goal finished with status: SUCCEEDED\n"


def test_feedback_is_shown_on_request(ask):
    lines = ask("send_goal", ACTION, GOAL % 2, "--feedback", "-o", "json").out.splitlines()
    *feedback, result = map(json.loads, lines)
    assert len(feedback) >= 20
    assert feedback[0]["feedback"]["joint_names"] == ["joint1"]
    assert result == {"result": {"error_code": 0, "error_string": "Goal successfully reached!"}}
    assert "Feedback:\n    header:" in ask("send_goal", ACTION, GOAL % 1, "-f").out


def test_a_rejected_an_aborted_and_a_late_goal_have_exit_codes(ask):
    done = ask("send_goal", ACTION, "{}", code=7)
    assert done.err == f"error: {ACTION} refused: joint_names is empty\n"
    tolerance = "path_tolerance: [{name: joint1, position: 0.001}]}"
    jump = "{trajectory: {joint_names: [joint1], points: [{positions: [1.5], time_from_start: {nanosec: 9000000}}]}, "
    aborted = ask("send_goal", ACTION, jump + tolerance, code=7)
    assert aborted.out.endswith("Goal finished with status: ABORTED\n")
    late = ask("send_goal", ACTION, GOAL % 100000, "--timeout", "0.2", code=6)
    assert "has not ended within" in late.err


@pytest.mark.parametrize(
    ("code", "words", "sentence"),
    [
        (1, ("send_goal", "/follow"), "unknown action '/follow'"),
        (2, ("send_goal", ACTION, "control_msgs/action/GripperCommand", "{}"), f"is {TYPE}, not control_msgs/action/"),
        (2, ("send_goal", ACTION, "{trajectry: {}}"), "unknown field 'trajectry', did you mean 'trajectory'"),
        (2, ("find", "control_msgs/Follow"), "unknown type"),
    ],
)
def test_errors_are_reported_in_one_sentence(ask, code, words, sentence):
    assert sentence in ask(*words, code=code).err


def test_ctrl_c_cancels_the_goal(server, tmp_path):
    process = warm_python.popen(
        COMMAND,
        ("action", "send_goal", ACTION, GOAL % 100000, "-e", server.endpoint),
        cwd=tmp_path,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        while "Goal accepted" not in process.stdout.readline():
            assert process.poll() is None
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=STARTING)
    finally:
        process.kill()
    assert (process.returncode, err) == (130, "Canceling goal...\n")
    with mock.patch.dict("os.environ", {"MJPLUG_CONNECT": server.endpoint}):
        status = typed("topic", "echo", f"{ACTION}/_action/status", "--once", "-o", "json").out
    # The last goal was cancelled.
    assert json.loads(status)["status_list"][-1]["status"] == 5


def test_the_node_lists_its_actions(server):
    with mock.patch.dict("os.environ", {"MJPLUG_CONNECT": server.endpoint}):
        text = typed("node", "info", "/mjplug").out
    assert f"    {ACTION}: {TYPE}\n" in text.partition("  Action Servers:\n")[2].partition("  Action Clients:\n")[0]


def test_names_of_actions_are_completed(server):
    assert live_names("actions", "/joint", server.endpoint) == [ACTION]
    assert live_names("actions", "/nothing", server.endpoint) == []
    assert complete_action_type("control_msgs/action/F") == [TYPE]
