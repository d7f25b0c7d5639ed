"""Actions: their derived types and hashes, and the CDR of derived messages."""

import json
from pathlib import Path

import pytest
from pydantic import Field
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from mjplug_schemas import action_msgs, control_msgs_action, registry, unique_identifier_msgs
from mjplug_schemas.action import Action
from mjplug_schemas.control_msgs import GripperCommand
from mjplug_schemas.definition import definition
from mjplug_schemas.errors import DefinitionError, UnknownType
from mjplug_schemas.idl import float64, string, uint8, uint64
from mjplug_schemas.message import Message, Service
from mjplug_schemas.rihs01 import type_hash
from mjplug_schemas.unique_identifier_msgs import UUID

VECTORS = json.loads((Path(__file__).parent / "vectors" / "actions.json").read_text())


class Result(Message, package="simulation_interfaces"):
    """As in simulation_interfaces."""

    result: uint8 = Field(0)
    error_message: string = Field("")


class SimulateSteps(Action, package="simulation_interfaces"):
    """An action as a plugin would define it, with the definition of simulation_interfaces."""

    class Goal(Message):
        """How many steps."""

        steps: uint64 = Field(0)

    class Result(Message):
        """The result."""

        result: Result = Field(Result())

    class Feedback(Message):
        """How many steps were taken, and are left."""

        completed_steps: uint64 = Field(0)
        remaining_steps: uint64 = Field(0)


# The official generator's hashes of the action and of everything that is derived from it.
OF_ACTION = SimulateSteps.derived() | {SimulateSteps.TYPE: SimulateSteps}
SHARED = {
    found.TYPE: found
    for module in (action_msgs, unique_identifier_msgs)
    for found in vars(module).values()
    if isinstance(found, type) and issubclass(found, Message | Service) and found.__module__ == module.__name__
}
# The definitions of control_msgs for Jazzy, without comments: fields of goals, results and feedback.
GRIPPER_STATE = "float64 position\nfloat64 effort\nbool stalled\nbool reached_goal\n"
UPSTREAM = {
    "FollowJointTrajectory_Goal": (
        "trajectory_msgs/JointTrajectory trajectory\n"
        "trajectory_msgs/MultiDOFJointTrajectory multi_dof_trajectory\n"
        "control_msgs/JointTolerance[] path_tolerance\n"
        "control_msgs/JointComponentTolerance[] component_path_tolerance\n"
        "control_msgs/JointTolerance[] goal_tolerance\n"
        "control_msgs/JointComponentTolerance[] component_goal_tolerance\n"
        "builtin_interfaces/Duration goal_time_tolerance\n"
    ),
    "FollowJointTrajectory_Result": "int32 error_code\nstring error_string\n",
    "FollowJointTrajectory_Feedback": (
        "std_msgs/Header header\nstring[] joint_names\n"
        "trajectory_msgs/JointTrajectoryPoint desired\ntrajectory_msgs/JointTrajectoryPoint actual\n"
        "trajectory_msgs/JointTrajectoryPoint error\nstring[] multi_dof_joint_names\n"
        "trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_desired\n"
        "trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_actual\n"
        "trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_error\n"
    ),
    "GripperCommand_Goal": "control_msgs/GripperCommand command\n",
    "GripperCommand_Result": GRIPPER_STATE,
    "GripperCommand_Feedback": GRIPPER_STATE,
    "ParallelGripperCommand_Goal": "sensor_msgs/JointState command\n",
    "ParallelGripperCommand_Result": "sensor_msgs/JointState state\nbool stalled\nbool reached_goal\n",
    "ParallelGripperCommand_Feedback": "sensor_msgs/JointState state\n",
}


@pytest.mark.parametrize("name", VECTORS["hashes"])
def test_the_types_of_actions_have_the_hashes_that_ros_gives_them(name):
    assert type_hash((OF_ACTION | SHARED)[name]) == VECTORS["hashes"][name]


def test_every_derived_type_was_compared():
    assert set(OF_ACTION | SHARED) <= set(VECTORS["hashes"])


@pytest.mark.parametrize("name", UPSTREAM)
def test_the_actions_of_control_msgs_have_the_fields_of_upstream(name):
    store = get_typestore(Stores.ROS2_JAZZY)
    for used in ("JointTolerance", "JointComponentTolerance", "GripperCommand"):
        message = registry.find(f"control_msgs/msg/{used}")
        store.register(get_types_from_msg(definition(message), message.TYPE))
    store.register(get_types_from_msg(UPSTREAM[name], f"control_msgs/msg/{name}"))
    part = registry.find(f"control_msgs/action/{name}")
    # rosbags knows no actions, so its message has another name.
    part_hash = store.hash_rihs01(f"control_msgs/msg/{name}")
    as_message = type(
        name, (Message,), dict(__annotations__=part.__annotations__, **_defaults(part)), package="control_msgs"
    )
    assert type_hash(as_message) == part_hash


def _defaults(part):
    return {name: Field(field.get_default()) for name, field in part.model_fields.items()}


@pytest.mark.parametrize("sample", VECTORS["cdr"], ids=lambda sample: sample["type"])
def test_derived_messages_have_the_bytes_of_ros(sample):
    kind = OF_ACTION[f"simulation_interfaces/action/{sample['type']}"]
    value = sample["value"]
    if "goal_id" in value:
        value = value | {"goal_id": {"uuid": bytes(value["goal_id"]["uuid"])}}
    message = kind(**value)
    assert message.to_cdr().hex() == sample["cdr"]
    assert kind.from_cdr(bytes.fromhex(sample["cdr"])) == message
    assert kind.from_json(message.to_json()) == message


def test_feedback_contains_the_identifier_of_its_goal():
    goal_id = UUID(uuid=bytes(range(16)))
    message = SimulateSteps.FeedbackMessage(goal_id=goal_id, feedback=SimulateSteps.Feedback(completed_steps=3))
    cdr = message.to_cdr()
    assert cdr.hex() == "00010000" + bytes(range(16)).hex() + "0300000000000000" + "0000000000000000"
    assert SimulateSteps.FeedbackMessage.from_cdr(cdr) == message


def test_derived_types_are_found_by_name():
    action = control_msgs_action.FollowJointTrajectory
    assert registry.find("control_msgs/action/FollowJointTrajectory") is action
    assert registry.find("control_msgs/action/FollowJointTrajectory_Goal") is action.Goal
    assert registry.find("control_msgs/action/FollowJointTrajectory_SendGoal") is action.SendGoal
    assert registry.find("control_msgs/action/FollowJointTrajectory_SendGoal_Request") is action.SendGoal.Request
    assert registry.find("control_msgs/action/FollowJointTrajectory_FeedbackMessage") is action.FeedbackMessage
    with pytest.raises(UnknownType):
        registry.find("control_msgs/action/FollowJointTrajectory_Request")


def test_a_message_and_an_action_may_share_a_name():
    assert registry.find("control_msgs/msg/GripperCommand") is GripperCommand
    assert registry.find("control_msgs/action/GripperCommand") is control_msgs_action.GripperCommand


def test_the_definition_of_an_action_has_three_parts():
    class Move(Action, package="probe"):
        """Moves."""

        class Goal(Message):
            """Where to."""

            x: float64 = Field(0.0, description="Position [m].")

        class Result(Message):
            """Nothing."""

        class Feedback(Message):
            """How far."""

            left: float64 = Field(0.0, description="Distance [m].")

    assert definition(Move) == ("# Moves.\n\n# Position [m].\nfloat64 x\n---\n---\n# Distance [m].\nfloat64 left\n")


def test_an_action_needs_all_three_parts():
    with pytest.raises(DefinitionError, match="probe/action/Half needs a nested class `Result` that is a Message"):

        class Half(Action, package="probe"):
            """Lacks a result and feedback."""

            class Goal(Message):
                """Nothing."""
