"""Goals of actions, sent through a live server: feedback, results, cancellation and errors."""

import json
import threading

import pytest

from mjplug import open_server
from mjplug.client import GoalFailed, RequestRefused, TimedOutError, UnknownNameError, WrongTypeError, connect
from mjplug_schemas.action_msgs import GoalStatusArray
from mjplug_schemas.control_msgs_action import FollowJointTrajectory
from mjplug_schemas.registry import find

ACTION = "/joint_commands/follow_joint_trajectory"
TIMEOUT = 60.0


@pytest.fixture(scope="module")
def server():
    with open_server("bundled:arm", plugins=["joint_commands"], settings={"sim": {"speed": 10.0}}) as server:
        yield server


@pytest.fixture
def client(server):
    with server.client() as client:
        yield client


def trajectory(seconds, position=0.3, joint="joint1"):
    sec, nanosec = divmod(round(seconds * 1e9), 10**9)
    point = {"positions": [position], "time_from_start": {"sec": sec, "nanosec": nanosec}}
    return {"joint_names": [joint], "points": [point]}


def test_a_goal_yields_feedback_and_then_its_result(client):
    goal = client.send_goal(ACTION, trajectory=trajectory(2.0))
    numbers = [feedback.desired.time_from_start.to_ns() for feedback in goal]
    assert len(numbers) >= 30
    assert numbers == sorted(numbers)
    assert goal.done
    assert goal.wait() == "SUCCEEDED"
    assert goal.result() == FollowJointTrajectory.Result(error_string="Goal successfully reached!")
    # The end can be asked for again.
    assert goal.next() is None
    assert list(goal) == []


def test_a_goal_may_be_a_message_or_a_dictionary(client):
    message = FollowJointTrajectory.Goal(trajectory=find("trajectory_msgs/msg/JointTrajectory")(**trajectory(0.1)))
    assert client.send_goal(ACTION, message).wait(TIMEOUT) == "SUCCEEDED"
    assert client.send_goal(ACTION, {"trajectory": trajectory(0.1, 0.0)}).wait(TIMEOUT) == "SUCCEEDED"


def test_feedback_that_nobody_reads_is_dropped(client):
    goal = client.send_goal(ACTION, trajectory=trajectory(1.0), depth=3)
    goal.wait(TIMEOUT)
    times = [feedback.desired.time_from_start.to_ns() for feedback in goal]
    assert goal.dropped >= 10
    assert len(times) <= 3


def test_a_callback_gets_the_feedback(client):
    seen = []
    goal = client.send_goal(ACTION, trajectory=trajectory(1.0), callback=seen.append)
    goal.wait(TIMEOUT)
    assert len(seen) >= 15
    assert seen[0].joint_names == ("joint1",)


def test_a_failing_callback_does_not_end_the_goal(client, caplog):
    goal = client.send_goal(ACTION, trajectory=trajectory(0.2), callback=lambda feedback: 1 / 0)
    assert goal.wait(TIMEOUT) == "SUCCEEDED"
    assert f"the callback for feedback of {ACTION} failed" in caplog.text


def test_a_goal_is_cancelled_while_others_wait_for_it(client):
    goal = client.send_goal(ACTION, trajectory=trajectory(10_000.0))
    ends = []
    waiting = [threading.Thread(target=lambda: ends.append(goal.wait(TIMEOUT))) for _ in range(3)]
    for thread in waiting:
        thread.start()
    assert goal.next(TIMEOUT) is not None
    assert not goal.done
    assert goal.cancel()
    for thread in waiting:
        thread.join(TIMEOUT)
    assert ends == ["CANCELED"] * 3
    with pytest.raises(GoalFailed, match=f"^the goal of {ACTION} was canceled: a client cancelled the goal") as failed:
        goal.result()
    assert (failed.value.status, failed.value.result.error_code) == ("CANCELED", 0)
    assert goal.result(check=False).error_code == 0
    assert not goal.cancel()


def test_an_aborted_goal_raises_with_its_reason(client):
    tolerance = [{"name": "joint1", "position": 0.01}]
    goal = client.send_goal(ACTION, trajectory=trajectory(0.01, 1.5), path_tolerance=tolerance)
    with pytest.raises(GoalFailed, match="was aborted: path tolerance: joint joint1: the position error is") as failed:
        goal.result(TIMEOUT)
    assert failed.value.result.error_code == FollowJointTrajectory.Result.PATH_TOLERANCE_VIOLATED


def test_a_wait_for_the_end_is_limited(client):
    goal = client.send_goal(ACTION, trajectory=trajectory(10_000.0))
    with pytest.raises(TimedOutError, match=r"has not ended within 0\.1 s"):
        goal.result(timeout=0.1)
    goal.cancel()


@pytest.mark.parametrize(
    ("error", "words", "fields"),
    [
        (RequestRefused, "refused: unknown commandable joint 'wrist'", {"trajectory": trajectory(1.0, joint="wrist")}),
        (WrongTypeError, "unknown field 'trajectry', did you mean 'trajectory'", {"trajectry": {}}),
    ],
)
def test_a_wrong_goal_is_refused_with_a_sentence(client, error, words, fields):
    with pytest.raises(error, match=words):
        client.send_goal(ACTION, **fields)


def test_an_unknown_action_is_reported(client):
    with pytest.raises(UnknownNameError, match=f"unknown action '/follow_joint_trajectory', did you mean '{ACTION}'"):
        client.send_goal("/follow_joint_trajectory")


def test_the_end_of_the_server_ends_the_goal():
    with open_server("bundled:arm", plugins=["joint_commands"]) as server, connect(server.endpoint) as client:
        goal = client.send_goal(ACTION, trajectory=trajectory(10_000.0))
        server.stop()
        with pytest.raises(GoalFailed, match="was aborted: cancelled: the server is stopping"):
            goal.result(TIMEOUT)


def test_the_parts_of_an_action_are_found_but_not_listed(client):
    # The server has an action of its own.
    assert {*client.actions()} >= {ACTION}
    assert [*client.actions()] == sorted(client.actions())
    action = client.action(ACTION)
    assert (action.type, action.server) == (FollowJointTrajectory.TYPE, "/mjplug")
    assert not any("_action" in name for name in (*client.topics(), *client.services()))
    assert client.find(ACTION) is FollowJointTrajectory
    assert client.wait_for(ACTION) == action
    client.send_goal(ACTION, trajectory=trajectory(0.1)).wait(TIMEOUT)
    status = client.subscribe(f"{ACTION}/_action/status").next(TIMEOUT)
    assert isinstance(status, GoalStatusArray)
    unknown = client.call(f"{ACTION}/_action/get_result", goal_id={"uuid": bytes(range(16))})
    assert unknown.status == 0


def test_a_stepped_server_accepts_a_goal_on_its_own_thread():
    with open_server("bundled:arm", plugins=["joint_commands"], run=False) as server, server.client() as client:
        goal = client.send_goal(ACTION, trajectory=trajectory(0.1))
        while not goal.done:
            server.step(10)
        assert goal.result().error_code == 0


def test_actions_without_a_class_use_json(server, monkeypatch):
    with server.client() as client:
        monkeypatch.setattr("mjplug.client.client.known", lambda name: None)
        goal = client.send_goal(ACTION, trajectory=trajectory(0.5))
        fed_back = list(goal)
        assert fed_back[0]["joint_names"] == ["joint1"]
        assert goal.result() == {"error_code": 0, "error_string": "Goal successfully reached!"}
        assert json.dumps(fed_back)
        assert not goal.cancel()
