"""Episodes: after a reset or a restore with a number, everything depends on this number and not on the past."""

import numpy as np
import pytest
from state_worlds import StateWorld
from wrenches import push

from mjplug.plugin import Host, Parameters, Plugin
from mjplug.services import reset_world
from mjplug.testing import World
from mjplug_schemas.mjplug_msgs import RestoreState
from mjplug_schemas.mujoco_ros2_control_msgs import ResetWorld
from mjplug_schemas.std_msgs import Float64

CONTINUING = {"/heartbeat/beat", "/wrench/wrench_markers"}
"""Topics with a counter, or with numbers of markers, that resets do not change."""


class Drawing(Plugin[Parameters]):
    """Publishes a random number, and draws one at each reset."""

    stateless = True

    def init(self, host: Host, parameters: Parameters) -> None:
        self.random = host.random
        self.publisher = host.create_publisher(Float64, "~/number")
        host.create_timer(0.01, lambda: self.publisher.publish(Float64(data=self.random.random())))

    def on_reset(self) -> None:
        self.random.random()


@pytest.fixture(scope="module")
def world():
    world = StateWorld()
    world.add(Drawing, "drawing")
    reset_world.offer(world.host("other"), world.loop)
    yield world
    world.close()


def reset(world, episode=None, **fields):
    parameters = {} if episode is None else {"episode": str(episode)}
    call = world.call("/other/reset_world", ResetWorld.Request(**fields), **parameters)
    assert call.refusal is None, call.refusal
    return call.response


def follow(world):
    """What happens in an episode: its digest, and all messages."""
    world.prepare(97)
    digest, told = world.run(400)
    return digest, {name: value for name, value in told.items() if name not in CONTINUING}


def test_episodes_of_one_number_are_equal_whatever_was_before(world):
    reset(world, 7)
    first = follow(world)
    assert sum(count > 5 for count, _ in first[1].values()) >= 7
    world.push(push("top", (1, 0, 3), duration=3.0))
    world.step(77)
    reset(world, 7)
    assert (world.simulation.step, world.data.time, world.simulation.lineage) == (0, 0.0, 7)
    assert follow(world) == first
    reset(world)
    world.step(31)
    reset(world, 8)
    other = follow(world)
    assert other[0] == first[0], "noise does not change the motion"
    changed = {name for name in first[1] if other[1][name] != first[1][name]}
    assert changed == {"/drawing/number", "/points", "/sensors/arm/imu"}


def test_the_first_episode_is_what_follows_the_start(world):
    fresh = StateWorld()
    expected = follow(fresh)
    reset(world, 0)
    digest, told = follow(world)
    told.pop("/drawing/number")
    assert (digest, told) == expected
    fresh.close()


def test_a_restored_state_may_begin_an_episode(world):
    reset(world, 1)
    world.prepare(50)
    world.save("half", overwrite=True)
    kept = world.run(200)

    def restore(**parameters):
        call = world.call("/mjplug/restore_state", RestoreState.Request(name="half"), **parameters)
        assert call.refusal is None
        return world.run(200)

    assert restore() == kept
    other = restore(episode="9")
    assert other[0] == kept[0]
    assert other[1]["/drawing/number"] != kept[1]["/drawing/number"]
    assert restore(episode="9") == other


@pytest.mark.parametrize("text", ["", "-1", "1.0", "x", "²", " 1", str(2**62), "9" * 5000])
def test_what_is_no_number_is_refused(world, text):
    before = world.simulation.epoch
    call = world.call("/other/reset_world", ResetWorld.Request(), episode=text)
    assert call.refusal.startswith("parameter episode is ")
    assert f"it must be a whole number from 0 to {2**62 - 1}; the world was not reset" in call.refusal
    assert world.simulation.epoch == before


def test_resets_are_counted_from_the_number_of_the_episode(world):
    reset(world, 2**62 - 1)
    reset(world)
    assert world.simulation.lineage == 2**62
    world.step(20)
    world.save("late", overwrite=True)
    world.restore("late")


DELAYED = """
<mujoco>
  <option timestep="0.002"/>
  <worldbody><body><joint name="j" type="slide"/><geom size=".1"/></body></worldbody>
  <actuator><position joint="j" kp="100" kv="1" delay="0.011" nsample="9" interp="{0}"/></actuator>
  <sensor><jointpos joint="j" delay=".013" nsample="9" interp="{0}"/></sensor>
  <keyframe><key name="moved" qpos=".1"/></keyframe>
</mujoco>
"""


@pytest.mark.parametrize("interpolation", ["zoh", "linear", "cubic"])
@pytest.mark.parametrize("keyframe", ["", "moved"])
def test_a_delayed_actuator_moves_as_before_after_a_reset(interpolation, keyframe):
    world = World(DELAYED.format(interpolation))
    reset_world.offer(world.host("other"), world.loop)

    def rows():
        found = []
        for number in range(30):
            world.data.ctrl[0] = np.sin(0.3 * number) + 0.2
            world.step(1)
            found.append([*world.data.qpos, *world.data.qvel, *world.data.sensordata])
        return np.array(found)

    reset(world, 0, keyframe=keyframe)
    first = rows()
    world.step(237)
    reset(world, keyframe=keyframe)
    assert np.allclose(rows(), first, rtol=0.0, atol=1e-13)
    reset(world, 0, keyframe=keyframe)
    assert np.array_equal(rows(), first)


class Choosing(Plugin[Parameters]):
    """Chooses a number at each reset, and does not save it."""

    def init(self, host: Host, parameters: Parameters) -> None:
        self.random, self.chosen = host.random, 0.0

    def on_reset(self) -> None:
        self.chosen = self.random.random()


def test_numbers_that_a_plugin_draws_at_a_reset_depend_on_the_episode_of_a_restored_state():
    world = StateWorld()
    plugin = world.add(Choosing, "choosing")
    world.prepare(3)
    world.save()
    chosen = {}
    for episode in (4, 5, 4, 5):
        world.step(7)
        plugin.random.random()
        call = world.call("/mjplug/restore_state", RestoreState.Request(name="s"), episode=str(episode))
        assert call.refusal is None
        assert chosen.setdefault(episode, plugin.chosen) == plugin.chosen
    assert chosen[4] != chosen[5]
    world.close()
