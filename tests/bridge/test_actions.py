"""Actions through the bridge: their five entities, as a ROS action client uses them."""

import pytest
from bridge.conftest import WORLD
from bridge.installation import install
from bridge.process import REAL
from cli.process import Served

from mjplug_schemas.action_msgs import GoalStatus, GoalStatusArray
from mjplug_schemas.control_msgs_action import FollowJointTrajectory

pytestmark = pytest.mark.ros

ACTION = "/own/joint_commands/follow_joint_trajectory/_action"
TYPE = "control_msgs/action/FollowJointTrajectory"
CANCEL = "action_msgs/srv/CancelGoal"
SUCCEEDED, CANCELED = GoalStatus.STATUS_SUCCEEDED, GoalStatus.STATUS_CANCELED


@pytest.fixture
def arm():
    server = Served("bundled:arm", "--plugin", "joint_commands", "--speed", "20", cwd=WORLD)
    yield server
    server.kill()


def identifier(number):
    return {"uuid": [number] * 16}


def goal(seconds, position=0.3):
    point = {"positions": [position], "time_from_start": {"sec": seconds}}
    return {"trajectory": {"joint_names": ["joint1"], "points": [point]}}


def send(ros, number, fields):
    return ros.call(f"{ACTION}/send_goal", f"{TYPE}_SendGoal", goal_id=identifier(number), goal=fields)


def ask_result(ros, number):
    return ros.send(f"{ACTION}/get_result", f"{TYPE}_GetResult", goal_id=identifier(number))


def test_a_goal_of_a_ros_client_is_executed_with_feedback_and_states(ros, arm, bridge):
    own = bridge(arm.endpoint)
    own.wait_for(r"topics, \d+ services and \d+ actions are mapped")
    feedback = ros.subscribe(f"{ACTION}/feedback", f"{TYPE}_FeedbackMessage")
    states = ros.subscribe(f"{ACTION}/status", "action_msgs/msg/GoalStatusArray", latched=True)
    assert send(ros, 1, goal(40)).accepted
    message = FollowJointTrajectory.FeedbackMessage.from_cdr(feedback.next())
    assert message.goal_id.uuid == bytes([1] * 16)
    assert message.feedback.joint_names == ("joint1",)
    waiting = ask_result(ros, 1)
    assert waiting.get().status == SUCCEEDED
    seen = []
    while SUCCEEDED not in seen:
        seen += [state.status for state in GoalStatusArray.from_cdr(states.next()).status_list]
    assert set(seen) == {GoalStatus.STATUS_EXECUTING, SUCCEEDED}


def test_a_goal_is_cancelled_and_a_result_is_waited_for_longer_than_the_timeout(ros, arm, bridge):
    bridge(arm.endpoint, service_timeout=1.0)
    assert send(ros, 2, goal(100_000)).accepted
    waiting = ask_result(ros, 2)
    # Longer than the timeout of other services.
    with pytest.raises(AssertionError, match="nothing within"):
        waiting._inbox.next(within=2.5)
    response = ros.call(f"{ACTION}/cancel_goal", CANCEL, goal_info={"goal_id": identifier(2)})
    assert response.return_code == 0
    assert waiting.get().status == CANCELED


def test_a_rejected_goal_and_an_unknown_one_are_answered(ros, arm, bridge):
    bridge(arm.endpoint)
    assert not send(ros, 3, {"trajectory": {"joint_names": ["wrist"]}}).accepted
    assert ask_result(ros, 3).get().status == GoalStatus.STATUS_UNKNOWN


def test_a_waiting_result_ends_with_the_server(ros, arm, bridge):
    own = bridge(arm.endpoint)
    assert send(ros, 4, goal(100_000)).accepted
    waiting = ask_result(ros, 4)
    own.wait_for("actions are mapped")
    arm.kill()
    assert waiting.get().status == GoalStatus.STATUS_UNKNOWN


@pytest.mark.skipif(REAL, reason="needs an installation without a package")
def test_an_action_whose_package_is_not_installed_is_left_out_as_a_whole(ros, arm, bridge, tmp_path):
    prefix = tmp_path / "other"
    install(prefix, without=("control_msgs",))
    own = bridge(arm.endpoint, env={"AMENT_PREFIX_PATH": str(prefix)})
    own.wait_for(r"follow_joint_trajectory \(control_msgs/action/FollowJointTrajectory\) is not mapped: the package")
    own.wait_for("are mapped")
    assert ros.types(f"{ACTION}/status") == []
