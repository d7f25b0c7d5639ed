import logging
import math

import mujoco
import numpy as np
import pytest

from mjplug.errors import MjplugError
from mjplug.physics.memory import SavedArrays
from mjplug.physics.reset import Reset
from mjplug.plugin import Parameters, Plugin
from mjplug.testing import World

HEAVY = """
<mujoco>
  <option timestep="0.002"/>
  <worldbody>
    <geom type="plane" size="5 5 .1"/>
    <body name="box" pos="0 0 .3" euler="10 20 30"><freejoint/><geom type="box" size=".1 .2 .1"/>
      <body pos="0 0 .2"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 .3" size=".02"/></body></body>
  </worldbody>
</mujoco>
"""


@pytest.fixture
def world():
    return World(mujoco.MjModel.from_xml_string(HEAVY))


def by_mujoco(held, steps):
    """The same with nothing but MuJoCo."""
    model = mujoco.MjModel.from_xml_string(HEAVY)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for _ in range(steps):
        for dof, velocity in held.items():
            data.qvel[dof] = velocity
        mujoco.mj_step(model, data)
    return data


def test_what_is_held_is_written_before_every_step_of_a_batch(world):
    hold = world.host().create_velocity_hold((0, 5, 6))
    hold.set(0.25, -1.0, 0.5)
    world.loop.step(700)
    expected = by_mujoco({0: 0.25, 5: -1.0, 6: 0.5}, 700)
    assert np.array_equal(world.data.qpos, expected.qpos)
    assert np.array_equal(world.data.qvel, expected.qvel)


def test_nothing_is_held_before_it_is_set_nor_after_its_release(world):
    hold = world.host().create_velocity_hold((0,))
    world.loop.step(50)
    assert np.array_equal(world.data.qvel, by_mujoco({}, 50).qvel)
    hold.set(1.0)
    hold.set(2.0)
    world.loop.step(1)
    hold.release()
    hold.release()
    world.data.qvel[0] = 0.1
    world.loop.step(1)
    assert world.data.qvel[0] == pytest.approx(0.1, abs=0.05)


def test_to_hold_no_degree_of_freedom_is_to_hold_nothing(world):
    hold = world.host("none").create_velocity_hold(())
    for _ in range(3):
        hold.set()
    assert world.simulation.holds == []


def test_a_held_velocity_outranks_an_override_of_the_same_step(world):
    class Driver(Plugin[Parameters]):
        def init(self, host, parameters):
            self.host = host
            host.activate()

        def update(self):
            self.host.velocity_override[:2] = 3.0

    hold = world.host().create_velocity_hold((0,))
    hold.set(-2.0)
    world.add(Driver, "driver")
    world.loop.step(1)
    assert world.data.qvel[0] == pytest.approx(-2.0, abs=0.2)
    assert world.data.qvel[1] == pytest.approx(3.0, abs=0.2)


@pytest.mark.parametrize("dof", [-1, 7])
def test_a_degree_of_freedom_that_is_not_there_is_refused(world, dof):
    with pytest.raises(MjplugError) as caught:
        world.host().create_velocity_hold((0, dof))
    assert str(caught.value) == f"degree of freedom {dof} does not exist; the model has 7, numbered from 0"


@pytest.mark.parametrize("values", [(math.nan, 0.0), (math.inf, -math.inf), (1.0,), (1.0, 2.0, 3.0)])
def test_what_cannot_be_held_is_refused_and_what_was_held_stays(world, values):
    hold = world.host().create_velocity_hold((0, 1))
    hold.set(0.5, 0.25)
    with pytest.raises(ValueError, match=r"all must be finite|velocities for"):
        hold.set(*values)
    assert hold.velocities == (0.5, 0.25)


def test_large_finite_velocities_whose_sum_is_not_are_no_mistake(world):
    hold = world.host().create_velocity_hold((0, 1))
    hold.set(1.7e308, 1.7e308)
    assert hold.velocities == (1.7e308, 1.7e308)


def test_a_velocity_that_makes_the_world_diverge_is_undone_at_its_very_step(world):
    world.loop.step(20)
    qpos, qvel = world.data.qpos.copy(), world.data.qvel.copy()
    hold = world.host().create_velocity_hold((0,))
    hold.set(1e12)
    world.loop.step(50)
    assert world.loop.paused
    assert world.simulation.step == 20
    assert np.array_equal(world.data.qpos, qpos)
    assert np.array_equal(world.data.qvel, qvel)


def test_a_divergence_within_a_held_batch_is_found_at_its_step(box_world):
    """The ball goes 2 million metres a step, and is too far away after 5000 steps."""
    hold = box_world.host().create_velocity_hold((6,))
    hold.set(1e9)
    box_world.loop.step(10_000)
    assert box_world.loop.paused
    assert 4999 <= box_world.simulation.step <= 5001
    assert box_world.data.qpos[7] == pytest.approx(2 + 2e6 * box_world.simulation.step, rel=1e-6)


def test_a_plugin_that_is_switched_off_holds_nothing_any_more(world, caplog):
    class Fragile(Plugin[Parameters]):
        def init(self, host, parameters):
            self.hold = host.create_velocity_hold((0,))
            self.hold.set(0.5)
            host.create_timer(0.02, self.fail)

        def fail(self):
            raise ZeroDivisionError

    host = world.host("fragile", disable_on_error=True)
    plugin = Fragile()
    host.attach(plugin)
    plugin.init(host, Parameters())
    with caplog.at_level(logging.CRITICAL):
        world.loop.step(11)
    assert plugin.hold.velocities == ()
    assert world.simulation.holds == []


def test_a_reset_leaves_holding_to_the_plugin(world):
    hold = world.host().create_velocity_hold((0,))
    hold.set(0.5)
    world.loop.step(5)
    world.loop.reset(Reset())
    world.loop.step(5)
    assert world.data.qpos[0] == pytest.approx(5 * 0.002 * 0.5, rel=0.1)


def test_saved_arrays_come_back_and_what_lies_between_them_is_left_alone():
    """Neighbours are copied in one piece, so what is between must not be put back with them."""
    store = np.arange(200.0)
    first, between, second, far = store[0:10], store[10:14], store[14:20], store[150:160]
    saved = SavedArrays([second, far, first, store[0:0]])
    saved.save()
    store[:] = -1.0
    between[:] = 77.0
    saved.restore()
    assert np.array_equal(first, np.arange(10.0))
    assert np.array_equal(between, [77.0] * 4)
    assert np.array_equal(second, np.arange(14.0, 20.0))
    assert np.array_equal(far, np.arange(150.0, 160.0))
    assert np.array_equal(store[20:150], [-1.0] * 130)
    assert len(saved._saves) == 2
