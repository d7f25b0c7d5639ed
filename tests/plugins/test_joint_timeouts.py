import math

from joint_robots import MIXED, compiled

from mjplug.physics.reset import Reset
from mjplug.testing import World
from mjplug_plugins.joints import JointCommands
from mjplug_schemas.builtin_interfaces import Duration
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.trajectory_msgs import JointTrajectory, JointTrajectoryPoint

WITH_FEEDFORWARD = MIXED.replace("</actuator>", '<motor name="feedforward" joint="shoulder"/></actuator>')


def world_of(xml=MIXED, **parameters):
    world = World(compiled(xml))
    world.plugin = world.add(JointCommands, "arm", command_timeout=0.1, **parameters)
    return world


def command(world, names, **values):
    world.transport.send("/arm/joint_commands", JointState(name=names, **values))
    world.loop.step(1)


def test_a_timeout_ends_velocities_and_efforts_and_leaves_positions():
    world = world_of()
    command(
        world, ["rail", "shoulder", "wrist"], velocity=[0.5, math.nan, math.nan], position=[math.nan, 0.3, math.nan]
    )
    world.loop.step(30)
    command(world, ["wrist"], effort=[0.2])
    world.loop.step(18)
    assert world.data.ctrl.tolist() == [0.5, 0.3, 0.0, 0.2]
    world.loop.step(2)
    assert world.data.ctrl.tolist() == [0.0, 0.3, 0.0, 0.2]
    world.loop.step(40)
    assert world.data.ctrl.tolist() == [0.0, 0.3, 0.0, 0.0]
    assert world.loop.steppers.active == ()


def test_a_timeout_does_not_end_what_came_after_the_command():
    gains = {"position": {"elbow": {"p": 5.0}}, "velocity": {"elbow": {"p": 1.0}}}
    world = world_of(pid_gains=gains)
    command(world, ["elbow"], velocity=[1.0])
    world.loop.step(20)
    command(world, ["elbow"], position=[0.3])
    world.loop.step(200)
    assert [bank.count for bank in world.plugin._joints.banks] == [1, 0]
    assert world.plugin._joints.banks[0].setpoint[0] == 0.3


def test_a_timeout_does_not_end_a_position_that_came_with_a_velocity_and_an_effort():
    """All three are for one motor, which follows the position."""
    world = world_of(pid_gains={"position": {"elbow": {"p": 5.0}}, "velocity": {"elbow": {"p": 1.0}}})
    command(world, ["elbow"], position=[0.3], velocity=[0.5], effort=[1.0])
    world.loop.step(200)
    assert [bank.count for bank in world.plugin._joints.banks] == [1, 0]


def test_a_timeout_ends_an_effort_beside_a_position_that_came_later():
    world = world_of(WITH_FEEDFORWARD)
    command(world, ["shoulder"], effort=[2.0])
    command(world, ["shoulder"], position=[0.4])
    world.loop.step(48)
    assert world.data.ctrl[[1, 4]].tolist() == [0.4, 2.0]
    world.loop.step(2)
    assert world.data.ctrl[[1, 4]].tolist() == [0.4, 0.0]


def test_a_timeout_ends_an_effort_beside_a_trajectory_that_came_later_and_continues():
    world = world_of(WITH_FEEDFORWARD)
    command(world, ["shoulder"], effort=[2.0])
    goal = JointTrajectoryPoint(positions=[0.5], time_from_start=Duration(sec=1))
    world.transport.send("/arm/joint_trajectory", JointTrajectory(joint_names=["shoulder"], points=[goal]))
    world.loop.step(600)
    assert world.data.ctrl[[1, 4]].tolist() == [0.5, 0.0]


def test_a_stream_keeps_the_timeout_away_and_a_reset_forgets_it():
    world = world_of()
    for _ in range(10):
        command(world, ["wrist"], effort=[0.2])
        world.loop.step(40)
        assert world.data.ctrl[3] == 0.2
    world.loop.reset(Reset())
    world.data.ctrl[3] = 0.7
    world.loop.step(200)
    assert world.data.ctrl[3] == 0.7
