import math
from itertools import pairwise

import mujoco
import numpy as np
import pytest
from conftest import World
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from mjplug.config.load import read
from mjplug.core.model_file import load_model
from mjplug.core.reset import Reset
from mjplug.errors import MjplugError
from mjplug.plugin.selection import select
from mjplug_plugins.base_velocity import BaseVelocity, BaseVelocityParameters
from mjplug_schemas.geometry_msgs import Twist, TwistStamped, Vector3

DT = 0.002

BALL = """
<mujoco>
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <body name="post" pos="5 0 0"><geom size=".1"/></body>
    <body name="other"><freejoint/><geom size=".1" pos="0 3 0"/></body>
    <body name="base"><freejoint/><geom size=".1" contype="0" conaffinity="0"/></body>
  </worldbody>
</mujoco>
"""
"""A base that nothing acts on: what it is given as velocity, it keeps within a step."""

BASE = slice(6, 12)
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

DOCUMENTED = """\
/**:
  ros__parameters:
    mujoco_plugins:
      base_velocity_plugin:
        type: "mujoco_ros2_control_plugins/BaseVelocityPlugin"
        body: base_link
        cmd_vel_topic: /cmd_vel
"""


def twist(vx=0.0, vy=0.0, yaw_rate=0.0, **others):
    linear, angular = {"x": vx, "y": vy}, {"z": yaw_rate}
    for name, value in others.items():
        (linear if name == "vz" else angular)[name[-1]] = value
    return Twist(linear=Vector3(**linear), angular=Vector3(**angular))


def world_of(xml=BALL, **parameters):
    world = World(mujoco.MjModel.from_xml_string(xml))
    world.plugin = world.add(BaseVelocity, "drive", **{"body": "base", **parameters})
    return world


def command(world, *values, **others):
    world.transport.send("/drive/cmd_vel", twist(*values, **others))


def velocity_in_body(world, qpos, qvel):
    """Linear and angular velocity of a state in the axes of the body, by MuJoCo itself."""
    data = mujoco.MjData(world.model)
    data.qpos[:], data.qvel[:] = qpos, qvel
    mujoco.mj_forward(world.model, data)
    velocity = np.empty(6)
    mujoco.mj_objectVelocity(world.model, data, mujoco.mjtObj.mjOBJ_XBODY, world.model.body("base").id, velocity, 1)
    return velocity[3:], velocity[:3]


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


NOT_FINITE = [(math.nan, 0, 0), (0, math.inf, 0), (0, 0, -math.inf), (math.nan, math.inf, math.nan)]


@pytest.mark.parametrize("bad", [(1e10, 0, 0), (8e9, 8e9, 0), (0, 0, -1e10), (1e300, 0, 0)])
def test_a_command_that_mujoco_would_take_for_a_divergence_is_ignored(bad):
    world = world_of()
    command(world, 1.0)
    world.loop.step(1)
    command(world, *bad)
    world.loop.step(5)
    assert not world.loop.paused
    assert tuple(world.data.qvel[[6, 7, 11]]) == (1.0, 0.0, 0.0)
    assert world.plugin.ignored == 1


def test_the_largest_command_below_that_is_driven():
    world = world_of("<mujoco><worldbody><body name='base'><freejoint/><geom size='1'/></body></worldbody></mujoco>")
    command(world, 0, 0, 9.9e9)
    world.loop.step(1)
    assert not world.loop.paused
    assert world.data.qvel[5] == 9.9e9


@pytest.mark.parametrize("bad", NOT_FINITE)
def test_a_command_that_is_not_finite_is_ignored_and_the_one_before_it_holds(bad):
    world = world_of(cmd_timeout=0.1, max_linear_velocity=5, max_yaw_rate=5)
    command(world, 1.0, 0.0, 0.0)
    world.loop.step(30)
    command(world, *bad)
    world.loop.step(21)
    assert tuple(world.data.qvel[[6, 7, 11]]) == (1.0, 0.0, 0.0)
    world.loop.step(1)
    assert tuple(world.data.qvel[[6, 7, 11]]) == (0.0, 0.0, 0.0)


def test_ignored_commands_are_counted_and_said_once_and_at_the_end(caplog):
    world = world_of()
    for bad in NOT_FINITE:
        command(world, *bad)
        world.loop.step(1)
    assert [r.getMessage() for r in caplog.records] == [
        "a command on /drive/cmd_vel was ignored: linear.x is nan, linear.y is 0, angular.z is 0; all must be finite "
        "and below 1e+10 (further ones are only counted)"
    ]
    assert world.plugin.ignored == 4
    world.plugin.cleanup()
    assert caplog.records[-1].getMessage() == "4 commands on /drive/cmd_vel were ignored in all"


def test_the_components_that_are_not_driven_do_not_matter():
    world = world_of()
    command(world, 1.0, 2.0, 3.0, vz=math.nan, wx=math.inf, wy=-5.0)
    world.loop.step(1)
    assert tuple(world.data.qvel[BASE]) == pytest.approx((1, 2, 0, 0, 0, 3), abs=1e-12)
    assert world.plugin.ignored == 0


def test_stamped_commands_count_from_their_reception_whatever_their_stamp_says():
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
        "plugin second holds the same velocities as drive: only one of them has its way"
    ]


def test_a_base_that_was_turned_by_hand_drives_along_its_new_heading():
    world = world_of()
    command(world, 1.0)
    world.loop.step(1)
    world.data.qpos[10:14] = (math.sqrt(0.5), 0, 0, math.sqrt(0.5))
    world.loop.step(1)
    assert world.data.qvel[6:8] == pytest.approx((0, 1), abs=1e-12)


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ("", "unknown body with a free joint ''; known: base, other"),
        ("bass", "unknown body with a free joint 'bass', did you mean 'base'?; known: base, other"),
        ("post", "body 'post' has no free joint; bodies with one: base, other"),
        ("world", "body 'world' has no free joint; bodies with one: base, other"),
    ],
)
def test_what_cannot_be_driven_is_refused_with_what_can(body, reason):
    with pytest.raises(MjplugError) as caught:
        world_of(body=body)
    assert str(caught.value) == reason


def test_a_model_without_free_joints_is_refused():
    with pytest.raises(MjplugError) as caught:
        world_of("<mujoco><worldbody><body name='base'><geom size='1'/></body></worldbody></mujoco>")
    assert str(caught.value) == "body 'base' has no free joint; no body of the model has one"


@pytest.mark.parametrize("name", ["max_linear_velocity", "max_yaw_rate", "cmd_timeout"])
@pytest.mark.parametrize("value", [0, -1.0, math.nan, -math.inf, "1", True])
def test_limits_and_timeout_must_be_positive_numbers(name, value):
    with pytest.raises(ValidationError):
        BaseVelocityParameters(body="base", **{name: value})


def parameters_of(tmp_path, text):
    (tmp_path / "plugins.yaml").write_text(text)
    _, (selected,) = select(read(tmp_path / "plugins.yaml", model="bundled:mobile_base"))
    return selected


def test_the_documented_configuration_loads_unchanged(tmp_path):
    selected = parameters_of(tmp_path, DOCUMENTED)
    assert selected.plugin_class is BaseVelocity
    assert selected.parameters == BaseVelocityParameters(
        body="base_link",
        cmd_vel_topic="/cmd_vel",
        use_stamped_twist=False,
        max_linear_velocity=math.inf,
        max_yaw_rate=math.inf,
        cmd_timeout=0.5,
    )


@pytest.mark.parametrize("infinity", [".inf", "inf", "+.inf"])
def test_an_infinite_limit_and_whole_numbers_can_be_written(tmp_path, infinity):
    more = f"        max_linear_velocity: {infinity}\n        max_yaw_rate: {infinity}\n        cmd_timeout: 2\n"
    parameters = parameters_of(tmp_path, DOCUMENTED + more).parameters
    assert (parameters.max_linear_velocity, parameters.max_yaw_rate) == (math.inf, math.inf)
    assert parameters.cmd_timeout == 2.0


def test_the_bundled_platform_drives_as_the_documented_configuration_says(tmp_path):
    world = World(load_model("bundled:mobile_base").model)
    world.add(BaseVelocity, "base_velocity_plugin", **parameters_of(tmp_path, DOCUMENTED).parameters.model_dump())
    assert world.transport.subscriptions == {"/cmd_vel"}
    world.loop.step(500)
    start = world.data.qpos[:3].copy()
    for _ in range(20):
        world.transport.send("/cmd_vel", twist(0.5, 0.0, 0.2))
        world.loop.step(50)
    heading = 2 * math.atan2(world.data.qpos[6], world.data.qpos[3])
    assert heading == pytest.approx(0.4, abs=1e-3)
    arc = np.array((math.sin(0.4), 1 - math.cos(0.4), 0)) * 0.5 / 0.2
    assert np.abs(world.data.qpos[:3] - start - arc).max() < 0.005
