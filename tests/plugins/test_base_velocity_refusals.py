"""What BaseVelocity takes as commands and parameters, and what it refuses or ignores."""

import math

import numpy as np
import pytest
from driven_base import command, twist, world_of
from pydantic import ValidationError

from mjplug.config.load import read
from mjplug.errors import MjplugError
from mjplug.model.file import load_model
from mjplug.plugin.selection import select
from mjplug.testing import World
from mjplug_plugins.base_velocity import BaseVelocity, BaseVelocityParameters

DOCUMENTED = """\
/**:
  ros__parameters:
    mujoco_plugins:
      base_velocity_plugin:
        type: "mujoco_ros2_control_plugins/BaseVelocityPlugin"
        body: base_link
        cmd_vel_topic: /cmd_vel
"""


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


def test_ignored_commands_are_counted_and_reported_once_and_at_the_end(caplog):
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


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        (
            "",
            "the parameter body is missing; bodies with a free joint: base, other; for example "
            "--set plugins.drive.body=base",
        ),
        ("bass", "unknown body with a free joint 'bass', did you mean 'base'?; known: base, other"),
        ("post", "body 'post' has no free joint; bodies with a free joint: base, other"),
        ("world", "body 'world' has no free joint; bodies with a free joint: base, other"),
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
