import math
from itertools import pairwise

import mujoco
import numpy as np
import pytest
from driven_base import BALL, BASE, DT, command, twist, velocity_in_body, world_of
from hypothesis import given, settings
from hypothesis import strategies as st

from mjplug.physics.reset import Reset
from mjplug.testing import World
from mjplug_plugins.base_velocity import BaseVelocity
from mjplug_schemas.geometry_msgs import TwistStamped

"""A base that nothing acts on: what it is given as velocity, it keeps within a step."""
"""Its velocities in qvel."""

SLOPE = """
<mujoco>
  <option timestep="0.002"/>
  <worldbody>
    <geom type="plane" size="20 20 .1" euler="0 -20 0" friction="0 0 0"/>
    <body name="base" euler="0 -20 0" pos="-0.0342 0 0.0940">
      <freejoint/><geom type="box" size=".3 .2 .1" mass="20" friction="0 0 0"/>
    </body>
  </worldbody>
</mujoco>
"""


def test_the_velocity_is_the_command_at_every_step_while_the_base_turns():
    world = world_of(cmd_timeout=10)
    command(world, 0.7, -0.4, 3.0)
    for _ in range(1500):
        before = world.data.qpos.copy()
        world.loop.step(1)
        linear, angular = velocity_in_body(world, before, world.data.qvel)
        assert np.abs(linear - (0.7, -0.4, 0.0)).max() < 1e-12
        assert np.abs(angular - (0.0, 0.0, 3.0)).max() < 1e-12


def test_a_base_that_drives_and_turns_goes_round_its_circle():
    """With v = 1 m/s and w = 0.8 rad/s the circle has a radius of 1.25 m; one turn takes 7.854 s."""
    world = world_of(cmd_timeout=20)
    command(world, 1.0, 0.0, 0.8)
    path = []
    for _ in range(round(2 * math.pi / 0.8 / DT)):
        world.loop.step(1)
        path.append(world.data.qpos[7:9].copy())
    assert np.abs(path[-1]).max() < 2e-3
    assert np.allclose(np.linalg.norm(np.subtract(path, (0.0, 1.25)), axis=1), 1.25, atol=2e-3)
    assert all(math.dist(a, b) == pytest.approx(1.0 * DT, rel=1e-9) for a, b in pairwise(path))


angle = st.floats(-math.pi, math.pi)
speed = st.floats(-10, 10)


@settings(deadline=None)
@given(yaw=angle, pitch=angle, roll=angle, vx=speed, vy=speed, yaw_rate=speed, vertical=speed)
def test_a_tilted_base_gets_the_horizontal_part_of_the_command(yaw, pitch, roll, vx, vy, yaw_rate, vertical):
    world = world_of()
    axes = np.empty(9)
    mujoco.mju_euler2Quat(world.data.qpos[10:14], np.array((yaw, pitch, roll)), "zyx")
    mujoco.mju_quat2Mat(axes, world.data.qpos[10:14])
    world.data.qvel[8] = vertical
    command(world, vx, vy, yaw_rate)
    world.loop.step(1)
    expected = axes.reshape(3, 3)[:, :2] @ (vx, vy)
    assert np.abs(world.data.qvel[6:8] - expected[:2]).max() < 1e-12
    assert world.data.qvel[8] == pytest.approx(vertical, abs=1e-12)
    assert world.data.qvel[11] == pytest.approx(yaw_rate, abs=1e-12)


def test_on_a_slope_the_speed_along_the_ground_is_the_command():
    world = World(mujoco.MjModel.from_xml_string(SLOPE))
    world.add(BaseVelocity, "drive", body="base", cmd_timeout=10)
    command(world, 2.0, 0.0, 0.0)
    world.loop.step(500)
    start = world.data.qpos[:3].copy()
    world.loop.step(1000)
    travelled = world.data.qpos[:3] - start
    # What is missing is what gravity takes within each step.
    assert np.linalg.norm(travelled) == pytest.approx(2.0 * 2.0, rel=0.01)
    assert math.atan2(travelled[2], travelled[0]) == pytest.approx(math.radians(20), abs=0.01)


def test_height_roll_pitch_and_all_else_are_left_to_physics():
    """A direct computation with nothing but MuJoCo, on a base that falls, tilts and rubs on the floor."""
    xml = """
    <mujoco>
      <option timestep="0.002"/>
      <worldbody>
        <geom type="plane" size="5 5 .1"/>
        <body name="base" pos="0 0 .5" euler="10 -20 30"><freejoint/><geom type="box" size=".2 .1 .1" pos=".03 0 .02"/>
          <body pos="0 0 .2"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 .3" size=".02"/></body></body>
      </worldbody>
    </mujoco>
    """
    world = World(mujoco.MjModel.from_xml_string(xml))
    world.add(BaseVelocity, "drive", body="base", cmd_timeout=10)
    command(world, 0.6, 0.1, 0.5)
    model = mujoco.MjModel.from_xml_string(xml)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    lowest = 1.0
    for _ in range(1500):
        axes = np.empty(9)
        mujoco.mju_quat2Mat(axes, data.qpos[3:7])
        data.qvel[:2] = axes.reshape(3, 3)[:2, :2] @ (0.6, 0.1)
        data.qvel[5] = 0.5
        mujoco.mj_step(model, data)
        world.loop.step(1)
        assert np.allclose(world.data.qpos, data.qpos, rtol=0, atol=1e-9)
        lowest = min(lowest, data.qpos[2])
    assert lowest < 0.2


def test_without_any_command_the_base_is_held_but_may_fall_and_tip():
    world = world_of()
    world.data.qvel[BASE] = (1, 2, 3, 4, 5, 6)
    world.loop.step(1)
    assert list(world.data.qvel[[6, 7, 11]]) == [0, 0, 0]
    assert list(world.data.qvel[8:11]) == pytest.approx([3, 4, 5], abs=0.1)
    world.loop.step(500)
    assert np.abs(world.data.qpos[7:9]).max() < 1e-15


@pytest.mark.parametrize(
    ("timestep", "timeout", "steps"),
    [
        (0.002, 0.1, 51),
        (0.002, 0.1009, 51),
        (0.002, 0.102, 52),
        (0.002, 0.001, 1),
        (1 / 240, 1 / 3, 81),
        (1 / 240, 1 / 240, 2),
        (0.0125, 0.5, 41),
    ],
)
def test_a_command_holds_while_its_age_is_at_most_the_timeout(timestep, timeout, steps):
    """The step that begins when the command comes has age 0, so one more step than fit into the timeout is driven."""
    world = world_of(BALL.replace("0.002", repr(timestep)), cmd_timeout=timeout)
    world.loop.step(3)
    command(world, 1.0)
    moved = []
    for _ in range(steps + 20):
        world.loop.step(1)
        moved.append(world.data.qvel[6])
    assert moved == [1.0] * steps + [0.0] * 20


def test_each_command_starts_the_timeout_again_and_the_newest_counts():
    world = world_of(cmd_timeout=0.1)
    command(world, 1.0)
    world.loop.step(40)
    command(world, 2.0)
    command(world, 3.0)
    world.loop.step(51)
    assert world.data.qvel[6] == 3.0
    world.loop.step(1)
    assert world.data.qvel[6] == 0.0


def test_the_timeout_stands_still_while_the_simulation_is_paused():
    world = world_of(cmd_timeout=0.1)
    command(world, 1.0)
    world.loop.step(10)
    world.loop.pause()
    for _ in range(100):
        world.loop.inbox.post(lambda: None)
        world.loop.turn()
    world.loop.resume()
    world.loop.step(41)
    assert world.data.qvel[6] == 1.0
    world.loop.step(1)
    assert world.data.qvel[6] == 0.0


def test_an_infinite_timeout_holds_a_command_for_ever():
    world = world_of(cmd_timeout=math.inf)
    command(world, 1.0)
    world.loop.step(20_000)
    assert world.data.qvel[6] == 1.0


@settings(deadline=None)
@given(vx=speed, vy=speed, limit=st.floats(0.01, 20))
def test_the_speed_limit_keeps_the_direction(vx, vy, limit):
    world = world_of(max_linear_velocity=limit)
    command(world, vx, vy)
    world.loop.step(1)
    got = world.data.qvel[6:8]
    asked = math.hypot(vx, vy)
    scale = min(1.0, limit / asked) if asked else 1.0
    assert got == pytest.approx((scale * vx, scale * vy), abs=1e-12)
    if asked <= limit:
        assert tuple(got) == (vx, vy)


@pytest.mark.parametrize(("asked", "got"), [(0.4, 0.4), (0.6, 0.5), (-0.4, -0.4), (-0.6, -0.5), (1e300, 0.5)])
def test_the_yaw_rate_is_limited_both_ways(asked, got):
    world = world_of(max_yaw_rate=0.5)
    command(world, 0, 0, asked)
    world.loop.step(1)
    assert world.data.qvel[11] == got


def test_the_largest_finite_speed_is_clamped_like_any_other():
    world = world_of(max_linear_velocity=1)
    command(world, 1e308, -1e308)
    world.loop.step(1)
    assert world.data.qvel[6:8] == pytest.approx((math.sqrt(0.5), -math.sqrt(0.5)), abs=1e-12)


def test_the_components_that_are_not_driven_do_not_matter():
    world = world_of()
    command(world, 1.0, 2.0, 3.0, vz=math.nan, wx=math.inf, wy=-5.0)
    world.loop.step(1)
    assert tuple(world.data.qvel[BASE]) == pytest.approx((1, 2, 0, 0, 0, 3), abs=1e-12)
    assert world.plugin.ignored == 0


def test_the_timeout_of_stamped_commands_starts_at_their_reception():
    world = world_of(use_stamped_twist=True, cmd_timeout=0.1)
    assert world.transport.types["/drive/cmd_vel"] is TwistStamped
    world.transport.send("/drive/cmd_vel", TwistStamped(twist=twist(1.0)))
    world.loop.step(51)
    assert world.data.qvel[6] == 1.0
    world.loop.step(1)
    assert world.data.qvel[6] == 0.0


def test_a_reset_stops_the_base():
    world = world_of(cmd_timeout=10)
    command(world, 1.0, 0.0, 1.0)
    world.loop.step(100)
    world.loop.reset(Reset())
    world.loop.step(100)
    assert not world.data.qpos[7:10].any()
    command(world, 1.0)
    world.loop.step(1)
    assert world.data.qvel[6] == 1.0


def test_only_the_named_body_is_driven_and_two_bases_do_not_disturb_each_other():
    world = world_of()
    world.add(BaseVelocity, "second", body="other")
    command(world, 1.0)
    world.transport.send("/second/cmd_vel", twist(0.0, 2.0))
    world.loop.step(1)
    assert tuple(world.data.qvel[[0, 1, 6, 7]]) == (0, 2, 1, 0)


def test_a_standing_base_needs_no_update_and_a_driven_one_does():
    world = world_of(cmd_timeout=0.1)
    assert world.loop.steppers.active == ()
    command(world, 1.0)
    world.loop.step(51)
    assert len(world.loop.steppers.active) == 1
    world.loop.step(1)
    assert world.loop.steppers.active == ()
    command(world, 1.0)
    world.loop.step(1)
    command(world, 0.0, 0.0, 0.0)
    world.loop.step(1)
    assert world.loop.steppers.active == ()
    assert tuple(world.data.qvel[[6, 7, 11]]) == (0.0, 0.0, 0.0)


def test_two_instances_that_drive_one_body_are_noticed(caplog):
    world = world_of()
    world.add(BaseVelocity, "second", body="base")
    assert [r.getMessage() for r in caplog.records] == [
        "plugins second and drive set the same velocities; only one of them takes effect"
    ]


def test_a_base_that_was_turned_by_hand_drives_along_its_new_heading():
    world = world_of()
    command(world, 1.0)
    world.loop.step(1)
    world.data.qpos[10:14] = (math.sqrt(0.5), 0, 0, math.sqrt(0.5))
    world.loop.step(1)
    assert world.data.qvel[6:8] == pytest.approx((0, 1), abs=1e-12)
