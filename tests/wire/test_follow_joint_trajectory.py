"""An arm on a whole server follows goals that are sent as a ROS 2 client with rmw_zenoh sends them."""

import time

import pytest
from wire.ros_peer import WHO, request

from mjplug import open_server
from mjplug.wire.rmw_zenoh.attachment import Attachment
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug_schemas.action_msgs import CancelGoal, GoalInfo, GoalStatus
from mjplug_schemas.builtin_interfaces import Duration
from mjplug_schemas.control_msgs import JointTolerance
from mjplug_schemas.control_msgs_action import FollowJointTrajectory, GripperCommand
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.trajectory_msgs import JointTrajectory, JointTrajectoryPoint
from mjplug_schemas.unique_identifier_msgs import UUID

TIMEOUT = 60.0
ROS = RosSettings()
ACTION = "/arm_controller/follow_joint_trajectory"
PLUGINS = {
    "arm_controller": {
        "type": "joint_commands",
        "grippers": {"gripper": {"joint": "gripper_left_finger_joint", "action": "/gripper_controller/gripper_cmd"}},
    },
    "joint_states": {"type": "joint_state_publisher", "topic": "/joint_states"},
}


@pytest.fixture(scope="module")
def server():
    settings = {"sim": {"speed": 20.0}, "ros2": {"domain_id": 0}}
    with open_server("bundled:arm", plugins=PLUGINS, settings=settings, listen="tcp/127.0.0.1:0") as server:
        yield server


@pytest.fixture
def client(server, client_of):
    client = client_of(server.endpoint)
    client.settle()
    return client


class Ros:
    """A client of one action on the keys of rmw_zenoh."""

    def __init__(self, client, name, action):
        self.client, self.name, self.action = client, name, action
        self.feedback = client.listen(ROS.data_key(f"{name}/_action/feedback", action.FeedbackMessage))
        client.settle()

    def call(self, name, service, message):
        key = ROS.data_key(f"{self.name}/_action/{name}", service)
        reply = request(self.client, key, message.to_cdr(), Attachment(1, time.time_ns(), WHO).to_bytes())
        return service.Response.from_cdr(bytes(reply.ok.payload))

    def send(self, goal_id, goal):
        service = self.action.SendGoal
        return self.call("send_goal", service, service.Request(goal_id=UUID(uuid=goal_id), goal=goal))

    def result(self, goal_id):
        service = self.action.GetResult
        return self.call("get_result", service, service.Request(goal_id=UUID(uuid=goal_id)))


def goal_of(seconds, positions, path=0.0):
    point = JointTrajectoryPoint(positions=positions, time_from_start=Duration.from_ns(round(seconds * 1e9)))
    return FollowJointTrajectory.Goal(
        trajectory=JointTrajectory(joint_names=("joint1", "joint2"), points=(point,)),
        path_tolerance=(JointTolerance(name="joint1", position=path),),
        goal_tolerance=tuple(JointTolerance(name=name, position=0.05) for name in ("joint1", "joint2")),
    )


def joint_positions(client):
    samples = client.listen(ROS.data_key("/joint_states", JointState))
    state = JointState.from_cdr(bytes(samples.get(timeout=TIMEOUT).payload))
    return dict(zip(state.name, state.position, strict=True))


def test_an_arm_follows_a_goal_of_a_ros_client(client):
    arm = Ros(client, ACTION, FollowJointTrajectory)
    goal_id = bytes(range(1, 17))
    assert arm.send(goal_id, goal_of(1.0, (0.5, -0.4))).accepted
    result = arm.result(goal_id)
    assert result.status == GoalStatus.STATUS_SUCCEEDED
    assert result.result == FollowJointTrajectory.Result(error_string="Goal successfully reached!")
    found = joint_positions(client)
    assert abs(found["joint1"] - 0.5) < 0.06
    assert abs(found["joint2"] + 0.4) < 0.06
    message = FollowJointTrajectory.FeedbackMessage.from_cdr(bytes(arm.feedback.get(timeout=TIMEOUT).payload))
    assert message.goal_id.uuid == goal_id
    assert message.feedback.joint_names == ("joint1", "joint2")


def test_a_ros_client_learns_that_a_path_tolerance_was_violated(client):
    arm = Ros(client, ACTION, FollowJointTrajectory)
    goal_id = bytes(range(2, 18))
    # No arm of this mass jumps by a radian in two milliseconds.
    assert arm.send(goal_id, goal_of(0.01, (1.5, 0.0), path=0.1)).accepted
    result = arm.result(goal_id)
    assert result.status == GoalStatus.STATUS_ABORTED
    assert result.result.error_code == FollowJointTrajectory.Result.PATH_TOLERANCE_VIOLATED


def test_a_ros_client_cancels_a_motion(client):
    arm = Ros(client, ACTION, FollowJointTrajectory)
    goal_id = bytes(range(3, 19))
    assert arm.send(goal_id, goal_of(100_000.0, (1.0, 1.0))).accepted
    cancel = CancelGoal.Request(goal_info=GoalInfo(goal_id=UUID(uuid=goal_id)))
    assert len(arm.call("cancel_goal", CancelGoal, cancel).goals_canceling) == 1
    assert arm.result(goal_id).status == GoalStatus.STATUS_CANCELED


def test_a_ros_client_moves_the_gripper(client):
    gripper = Ros(client, "/gripper_controller/gripper_cmd", GripperCommand)
    goal_id = bytes(range(4, 20))
    goal = GripperCommand.Goal(command={"position": -0.02})
    assert gripper.send(goal_id, goal).accepted
    result = gripper.result(goal_id)
    assert (result.status, result.result.reached_goal) == (GoalStatus.STATUS_SUCCEEDED, True)
    assert abs(result.result.position + 0.02) < 0.01
