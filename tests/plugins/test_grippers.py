"""The actions GripperCommand and ParallelGripperCommand of JointCommands."""

import math

import pytest

from mjplug.plugin import PluginError
from mjplug.testing import World
from mjplug_plugins.joints import JointCommands
from mjplug_schemas.action_msgs import GoalStatus
from mjplug_schemas.control_msgs_action import GripperCommand, ParallelGripperCommand
from mjplug_schemas.sensor_msgs import JointState

ACTION = "/hand/gripper/gripper_cmd"
SUCCEEDED, CANCELED, ABORTED = GoalStatus.STATUS_SUCCEEDED, GoalStatus.STATUS_CANCELED, GoalStatus.STATUS_ABORTED

# A finger on a slide; a block at 0.06 m stops it.
HAND = """
<mujoco>
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <body>
      <joint name="finger" type="slide" axis="1 0 0" damping="20"/><geom type="box" size=".01 .01 .01" mass=".1"/>
    </body>
    <body><joint name="wrist" axis="0 0 1"/><geom type="box" pos="0 0 1" size=".01 .01 .01" mass=".1"/></body>
    <geom type="box" pos="0.08 0 0" size=".01 .02 .02"/>
  </worldbody>
  <actuator><position name="finger" joint="finger" kp="200"/><motor name="wrist" joint="wrist"/></actuator>
</mujoco>
"""


def new_world(**gripper):
    world = World(HAND)
    world.add(JointCommands, "hand", grippers={"gripper": {"joint": "finger", "goal_tolerance": 0.002, **gripper}})
    return world


def close(position, effort=0.0):
    return GripperCommand.Goal(command={"position": position, "max_effort": effort})


def run(world, goal, seconds=10.0):
    for _ in range(round(seconds / 0.002)):
        if goal.ended:
            return
        world.step(1)
    assert goal.ended


def test_a_gripper_reaches_its_goal_with_feedback():
    world = new_world()
    goal = world.send_goal(ACTION, close(0.04))
    run(world, goal)
    assert goal.status == SUCCEEDED
    assert (goal.result.reached_goal, goal.result.stalled) == (True, False)
    assert goal.result.position == pytest.approx(0.04, abs=0.002)
    assert goal.result.position == pytest.approx(world.data.qpos[0], abs=0.002)
    assert goal.fed_back
    assert [feedback.position for feedback in goal.fed_back] == sorted(f.position for f in goal.fed_back)


@pytest.mark.parametrize(("allow", "status"), [(False, ABORTED), (True, SUCCEEDED)])
def test_a_gripper_that_holds_something_stalls(allow, status):
    world = new_world(allow_stalling=allow, stall_timeout=0.3)
    goal = world.send_goal(ACTION, close(0.08))
    run(world, goal)
    assert goal.status == status
    assert (goal.result.reached_goal, goal.result.stalled) == (False, True)
    assert goal.result.position == pytest.approx(0.06, abs=0.005)
    # It presses on.
    assert goal.result.effort == pytest.approx(200 * (0.08 - goal.result.position), rel=0.05)
    world.step(500)
    assert world.data.ctrl[0] == 0.08


def test_a_cancelled_gripper_holds_its_position():
    world = new_world()
    goal = world.send_goal(ACTION, close(0.05))
    world.step(20)
    world.cancel_goal(ACTION, goal)
    assert goal.status == CANCELED
    assert world.data.ctrl[0] == world.data.qpos[0] == goal.result.position
    assert 0.0 < goal.result.position < 0.05


def test_a_new_goal_and_another_command_replace_the_goal():
    world = new_world()
    first = world.send_goal(ACTION, close(0.05))
    world.step(5)
    second = world.send_goal(ACTION, close(0.05))
    world.step(6)
    assert (first.status, first.result.reached_goal) == (ABORTED, False)
    world.publish("/hand/joint_commands", JointState(name=["finger"], position=[0.01]))
    world.step(6)
    assert (second.status, second.result.reached_goal) == (ABORTED, False)


def test_a_parallel_gripper_reports_the_joint():
    world = new_world(type="ParallelGripperCommand", action="/gripper_cmd")
    goal = world.send_goal(
        "/gripper_cmd", ParallelGripperCommand.Goal(command=JointState(name=["finger"], position=[0.04]))
    )
    run(world, goal)
    assert (goal.status, goal.result.reached_goal) == (SUCCEEDED, True)
    state = goal.result.state
    assert (state.name, len(state.velocity), len(state.effort)) == (("finger",), 1, 1)
    assert state.position[0] == pytest.approx(0.04, abs=0.002)
    assert goal.fed_back[0].state.name == ("finger",)


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (JointState(), "command.position contains 0 numbers; it must contain one"),
        (JointState(position=[1.0, 2.0]), "command.position contains 2 numbers; it must contain one"),
        (JointState(name=["thumb"], position=[1.0]), "command.name is 'thumb'; the joint is 'finger'"),
        (JointState(position=[math.nan]), "command.position[0] is nan; it must be finite"),
    ],
)
def test_an_invalid_goal_is_rejected(command, reason):
    world = new_world(type="ParallelGripperCommand")
    goal = world.send_goal(ACTION, ParallelGripperCommand.Goal(command=command))
    assert goal.refusal.startswith(reason)
    assert not world.data.ctrl.any()


def test_a_goal_that_is_not_finite_is_rejected():
    assert "command.position is inf" in new_world().send_goal(ACTION, close(math.inf)).refusal


def test_a_reset_aborts_the_goal():
    world = new_world()
    goal = world.send_goal(ACTION, close(0.05))
    world.step(20)
    world.reset()
    assert goal.status == ABORTED
    world.step(100)
    assert world.data.qpos[0] == 0.0


def test_a_joint_without_position_commands_is_no_gripper():
    with pytest.raises(PluginError, match="gripper 'gripper': joint 'wrist' accepts effort commands, not position"):
        new_world(joint="wrist")
