"""A base on two wheels follows velocity commands as far as friction lets it."""

import math

import mujoco
import pytest

from mjplug.plugin import PluginError
from mjplug.testing import World
from mjplug_plugins.diff_drive import DiffDrive
from mjplug_schemas.geometry_msgs import Twist, TwistStamped, Vector3

ROVER = """
<mujoco>
  <compiler autolimits="true"/>
  <worldbody>
    <geom type="plane" size="0 0 .1"/>
    <body name="base" pos="0 0 .101"><freejoint/>
      <geom type="box" size=".2 .15 .03" mass="5"/>
      <geom type="sphere" size=".05" pos="-.15 0 -.05" mass=".2" friction=".02" priority="1"/>
      <body name="l" pos=".1 .2 0"><joint name="left" axis="0 1 0" damping=".01"/>
        <geom type="cylinder" size=".1 .02" euler="90 0 0" mass=".5"/></body>
      <body name="r" pos=".1 -.2 0"><joint name="right" axis="0 -1 0" damping=".01"/>
        <geom type="cylinder" size=".1 .02" euler="90 0 0" mass=".5"/></body>
    </body>
  </worldbody>
  <actuator>
    <velocity name="left" joint="left" kv="2"/><velocity name="right" joint="right" kv="2" ctrlrange="-20 20"/>
  </actuator>
</mujoco>
"""


def world_of(xml=ROVER, **parameters):
    world = World(mujoco.MjModel.from_xml_string(xml))
    world.drive = world.add(DiffDrive, "drive", **{"wheel_radius": 0.1, **parameters})
    return world


def twist(forward, yaw_rate=0.0):
    return Twist(linear=Vector3(x=forward), angular=Vector3(z=yaw_rate))


def test_it_drives_straight_and_stops_after_the_timeout():
    world = world_of(cmd_timeout=2.0)
    world.publish("/cmd_vel", twist(0.5))
    world.loop.step(500)
    assert world.data.ctrl.tolist() == pytest.approx([5.0, -5.0])
    begin = world.data.qpos[0]
    world.loop.step(400)
    assert (world.data.qpos[0] - begin) / 0.8 == pytest.approx(0.5, rel=0.05)
    assert abs(world.data.qpos[1]) < 0.02
    world.loop.step(600)
    assert world.data.ctrl.tolist() == [0.0, 0.0]
    assert abs(world.data.qvel[0]) < 0.01


def test_it_turns_at_the_yaw_rate():
    world = world_of(cmd_timeout=10.0)
    world.publish("/cmd_vel", twist(0.0, 0.8))
    world.loop.step(500)
    assert world.data.ctrl.tolist() == pytest.approx([-1.6, -1.6])
    assert world.data.qvel[5] == pytest.approx(0.8, rel=0.1)


def test_a_given_separation_replaces_that_of_the_model_and_controls_stay_in_their_range():
    world = world_of(wheel_separation=1.0, use_stamped_twist=True, cmd_vel_topic="go", wheels=["left", "right"])
    world.publish("/drive/go", TwistStamped(twist=twist(0.0, 1.0)))
    world.loop.step(1)
    assert world.data.ctrl.tolist() == pytest.approx([-5.0, -5.0])
    world.publish("/drive/go", TwistStamped(twist=twist(100.0)))
    world.loop.step(1)
    assert world.data.ctrl.tolist() == pytest.approx([1000.0, -20.0])


def test_a_reset_stops_the_wheels_and_commands_that_are_not_finite_are_ignored():
    world = world_of()
    world.publish("/cmd_vel", twist(0.5))
    world.loop.step(10)
    world.reset()
    assert world.data.ctrl.tolist() == [0.0, 0.0]
    world.publish("/cmd_vel", twist(math.nan))
    world.publish("/cmd_vel", twist(0.0, math.inf))
    world.loop.step(1)
    assert world.data.ctrl.tolist() == [0.0, 0.0]
    assert world.drive.ignored == 2


@pytest.mark.parametrize("speed", [1e10, 1e12, 1e308, -1e308])
def test_commands_that_are_too_large_are_ignored_and_other_actuators_keep_their_controls(speed):
    world = world_of()
    world.publish("/cmd_vel", twist(0.5))
    world.loop.step(1)
    before = world.data.ctrl.tolist()
    world.publish("/cmd_vel", twist(speed))
    world.publish("/cmd_vel", twist(speed, speed))
    world.loop.step(1)
    assert (world.data.ctrl.tolist(), world.drive.ignored) == (before, 2)
    assert world.data.warning[mujoco.mjtWarning.mjWARN_BADCTRL].number == 0


@pytest.mark.parametrize(
    ("xml", "parameters", "message"),
    [
        (ROVER, {"wheel_radius": 0.0}, "wheel_radius is missing"),
        (ROVER, {"wheels": ["front"]}, "'front' is no hinge with a velocity servo; hinges with one: left, right"),
        (ROVER.replace('axis="0 1 0"', 'axis="1 0 0"'), {}, "the axis of wheel 'left' is not parallel"),
        (ROVER.replace('pos=".1 -.2 0"', 'pos="0 .2 0"'), {}, "the wheels are not on both sides of body 'base'"),
    ],
)
def test_what_cannot_be_driven_is_refused(xml, parameters, message):
    with pytest.raises(PluginError, match=message):
        world_of(xml, **parameters)


def test_a_restored_command_ends_when_it_would_have_ended():
    world = world_of(cmd_timeout=1.0)
    world.publish("/cmd_vel", twist(0.5, 0.2))
    world.step(100)
    state = world.save()

    def run():
        controls = []
        for _ in range(25):
            world.step(20)
            controls.append(world.data.ctrl.tolist())
        return controls, world.data.qpos.tolist()

    expected = run()
    assert expected[0][0] != expected[0][-1] == [0.0, 0.0]
    world.restore(state)
    assert run() == expected
