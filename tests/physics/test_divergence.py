"""What the loop does when the simulation diverges, or when an update fails."""

import mujoco
import numpy as np
import pytest
from conftest import ARM
from recorder import Recorder

from mjplug.physics.reset import Reset
from mjplug.testing import World

PENDULUM_THAT_BLOWS_UP = """
<mujoco>
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <body name="rod"><joint name="hinge" type="hinge"/><geom type="capsule" size=".05 .5"/></body>
    <body name="cart" pos="0 5 0"><joint name="rail" type="slide" axis="0 1 0"/>
      <geom type="sphere" size=".1" mass="1"/></body>
  </worldbody>
  <actuator><general joint="rail" biastype="affine" biasprm="0 0 40"/></actuator>
</mujoco>
"""


def diverging_world(policy):
    world = World(mujoco.MjModel.from_xml_string(PENDULUM_THAT_BLOWS_UP), on_divergence=policy)
    world.data.qvel[1] = 1.0
    return world


def first_bad_step():
    """Finds with MuJoCo alone at which step the model blows up."""
    model = mujoco.MjModel.from_xml_string(PENDULUM_THAT_BLOWS_UP)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    data = mujoco.MjData(model)
    data.qvel[1] = 1.0
    for step in range(1, 100_000):
        mujoco.mj_step(model, data)
        if data.warning.number[3:6].any():
            return step
    raise AssertionError("the model does not blow up")


def test_divergence_pauses_before_the_very_step_and_names_the_joint(caplog):
    world = diverging_world("pause")
    bad = first_bad_step()
    world.loop.step(bad + 500)
    assert world.loop.paused
    assert world.simulation.step == bad - 1
    assert np.isfinite(world.data.qpos).all()
    assert f"diverged in step {bad} " in caplog.text
    assert "joint rail (coordinate 0, body cart)" in caplog.text


def test_a_divergence_is_found_at_the_same_step_whether_batched_or_not():
    world = diverging_world("pause")
    recorder = Recorder(world.simulation)
    world.loop.steppers.add(recorder)
    world.loop.steppers.activate(recorder)
    world.loop.step(first_bad_step() + 500)
    assert world.simulation.step == first_bad_step() - 1


def test_divergence_with_reset_policy_restores_the_initial_state_and_continues(caplog):
    world = diverging_world("reset")
    world.loop.step(first_bad_step() + 500)
    assert world.simulation.epoch == 1
    assert world.simulation.step == first_bad_step() + 500
    assert world.data.qvel[1] == 0.0
    assert "the world is reset" in caplog.text


def test_divergence_with_stop_policy_ends_the_loop_with_the_reason():
    world = diverging_world("stop")
    world.loop.run()
    assert "joint rail" in str(world.loop.failure)


def test_after_a_divergence_a_reset_makes_the_simulation_run_again():
    world = diverging_world("pause")
    world.loop.step(first_bad_step())
    world.loop.reset(Reset())
    world.loop.resume()
    world.loop.step(100)
    assert not world.loop.paused
    assert world.simulation.step == first_bad_step() - 1 + 100


def test_a_world_that_diverges_again_right_after_its_reset_is_paused_instead_of_reset_for_ever(caplog):
    world = diverging_world("reset")

    class Poison:
        def update(self):
            world.data.qvel[1] = np.inf

        def on_reset(self):
            pass

    poison = Poison()
    world.loop.steppers.add(poison)
    world.loop.steppers.activate(poison)
    world.loop.step(1000)
    assert world.loop.paused
    assert world.simulation.epoch == 1
    assert "paused before that step (less than 10 steps after a reset)" in caplog.text


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "RK4"])
@pytest.mark.parametrize("active", [False, True], ids=["batch", "active"])
def test_after_a_divergence_is_repaired_the_world_continues_without_a_reset(integrator, active):
    """MuJoCo's warm start holds NaN after a bad step; it must be rewound with the state."""
    world = World(
        mujoco.MjModel.from_xml_string(
            f"""<mujoco><option timestep="0.002" integrator="{integrator}"/><worldbody>
            <geom type="plane" size="5 5 .1"/>
            <body name="box" pos="0 0 .1"><freejoint/><geom type="box" size=".1 .1 .1"/></body>
            </worldbody></mujoco>"""
        )
    )
    poison = [np.nan]

    class Pusher(Recorder):
        def update(self):
            world.data.xfrc_applied[1, 0] = poison[0]

    pusher = Pusher(world.simulation)
    world.loop.steppers.add(pusher)
    world.loop.step(20)
    if active:
        world.loop.steppers.activate(pusher)
    else:
        world.data.xfrc_applied[1, 0] = np.nan
    world.loop.step(50)
    assert world.loop.paused
    assert world.simulation.step == 20
    poison[0] = 0.0
    world.data.xfrc_applied[:] = 0.0
    world.loop.resume()
    world.loop.step(50)
    assert not world.loop.paused
    assert world.simulation.step == 70
    assert np.isfinite(world.data.qacc_warmstart).all()


def test_a_bad_velocity_override_is_undone_with_the_step_that_it_spoils(box_world):
    class Driver(Recorder):
        def update(self):
            box_world.loop.steppers.velocity_override[0] = 1e12

    box_world.data.qvel[0] = 0.25
    driver = Driver(box_world.simulation)
    box_world.loop.steppers.add(driver)
    box_world.loop.steppers.activate(driver)
    box_world.loop.step(5)
    assert box_world.loop.paused
    assert box_world.data.qvel[0] == 0.25


def test_what_a_failing_update_wrote_does_not_reach_physics(box_world):
    class Broken(Recorder):
        def update(self):
            box_world.data.xfrc_applied[1, 0] = 1000.0
            box_world.loop.steppers.velocity_override[1] = 7.0
            raise ZeroDivisionError

        def failed(self, error):
            pass

    class Pusher(Recorder):
        def update(self):
            box_world.data.xfrc_applied[2, 0] += 1.0

    broken, pusher = Broken(box_world.simulation), Pusher(box_world.simulation)
    for stepper in (pusher, broken):
        box_world.loop.steppers.add(stepper)
        box_world.loop.steppers.activate(stepper)
    box_world.loop.step(1)
    assert not box_world.data.qvel[:6].any()
    assert box_world.data.qvel[6] == pytest.approx(0.002, rel=1e-9)


@pytest.mark.parametrize("active", [False, True], ids=["batch", "active"])
def test_after_a_divergence_time_has_the_bits_that_it_had_before_that_step(active):
    """MuJoCo adds up time steps, so after many of them its time is not the step number times the time step."""
    world = World(mujoco.MjModel.from_xml_string(ARM.replace('timestep="0.002"', 'timestep="0.0001"')))
    recorder = Recorder(world.simulation)
    world.loop.steppers.add(recorder)
    if active:
        world.loop.steppers.activate(recorder)
    world.loop.step(1000)
    before, step = world.data.time, world.simulation.step
    assert before != world.simulation.time.seconds(step)
    world.data.qvel[0] = np.inf
    world.loop.step(50)
    assert world.loop.paused
    assert world.simulation.step == step
    assert world.data.time == before
