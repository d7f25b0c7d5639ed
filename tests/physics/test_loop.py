"""The loop on the physics thread: steps, timers, updates and calls."""

from time import perf_counter

import mujoco
import numpy as np
import pytest
from recorder import Recorder

from mjplug.errors import ModelError
from mjplug.physics import loop
from mjplug.physics.reset import Reset
from mjplug.physics.simulation import Simulation
from mjplug.testing import World
from mjplug_schemas.std_msgs import String


def test_a_batched_run_is_bit_identical_to_single_mujoco_steps(arm_model, arm_world):
    data = mujoco.MjData(arm_model)
    arm_world.loop.step(1000)
    for _ in range(1000):
        mujoco.mj_step(arm_model, data)
    assert np.array_equal(arm_world.data.qpos, data.qpos)
    assert np.array_equal(arm_world.data.qvel, data.qvel)
    assert arm_world.simulation.step == 1000
    assert arm_world.simulation.time_ns == 2_000_000_000


def test_active_steppers_do_not_change_physics(arm_model):
    quiet, busy = World(arm_model), World(arm_model)
    recorder = Recorder(busy.simulation)
    busy.loop.steppers.add(recorder)
    busy.loop.steppers.activate(recorder)
    quiet.loop.step(500)
    busy.loop.step(500)
    assert recorder.updates == list(range(500))
    assert np.array_equal(quiet.data.qpos, busy.data.qpos)


def test_an_inactive_stepper_is_not_called(arm_world):
    recorder = Recorder(arm_world.simulation)
    arm_world.loop.steppers.add(recorder)
    arm_world.loop.step(10)
    arm_world.loop.steppers.activate(recorder)
    arm_world.loop.step(3)
    arm_world.loop.steppers.deactivate(recorder)
    arm_world.loop.step(10)
    assert recorder.updates == [10, 11, 12]


def test_timers_see_the_state_right_after_their_step(arm_world, arm_model):
    seen = []
    host = arm_world.host()
    host.create_timer(0.01, lambda: seen.append((host.step, arm_world.data.qpos.copy())))
    arm_world.loop.step(20)
    data = mujoco.MjData(arm_model)
    mujoco.mj_step(arm_model, data, nstep=5)
    assert [step for step, _ in seen] == [5, 10, 15, 20]
    assert np.array_equal(seen[0][1], data.qpos)


def test_kinematics_are_those_of_the_current_positions_at_a_boundary(arm_world):
    arm_world.loop.step(7)
    stale = arm_world.data.xpos.copy()
    arm_world.simulation.kinematics()
    fresh = mujoco.MjData(arm_world.model)
    fresh.qpos[:] = arm_world.data.qpos
    mujoco.mj_kinematics(arm_world.model, fresh)
    assert np.array_equal(arm_world.data.xpos, fresh.xpos)
    assert not np.array_equal(stale, fresh.xpos)


def test_a_finite_velocity_override_is_written_right_before_the_step_and_nan_leaves_it(box_world):
    class Driver:
        def update(self):
            box_world.loop.steppers.velocity_override[0] = 0.7

        def on_reset(self):
            pass

    driver = Driver()
    box_world.data.qvel[1] = 0.3
    box_world.loop.steppers.add(driver)
    box_world.loop.steppers.activate(driver)
    box_world.loop.step(100)
    assert box_world.data.qvel[0] == 0.7
    assert box_world.data.qpos[0] == pytest.approx(0.7 * 0.2, abs=1e-12)
    assert box_world.data.qpos[1] == pytest.approx(0.3 * 0.2, abs=1e-12)
    box_world.loop.steppers.deactivate(driver)
    box_world.data.qvel[0] = 0.1
    box_world.loop.step(10)
    assert box_world.data.qvel[0] == pytest.approx(0.1, abs=1e-12)


def test_forces_are_cleared_before_the_updates_and_when_no_plugin_is_active(box_world):
    class Pusher:
        def update(self):
            assert not box_world.data.xfrc_applied.any()
            assert not box_world.data.qfrc_applied.any()
            box_world.data.xfrc_applied[1, 0] += 4.0
            box_world.data.qfrc_applied[1] += 2.0

        def on_reset(self):
            pass

    pusher = Pusher()
    box_world.loop.steppers.add(pusher)
    box_world.loop.steppers.activate(pusher)
    box_world.loop.step(50)
    box_world.loop.steppers.deactivate(pusher)
    assert not box_world.data.xfrc_applied.any()
    assert not box_world.data.qfrc_applied.any()


def test_posted_calls_run_between_steps_in_order(arm_world):
    ran = []
    arm_world.loop.inbox.post(lambda: ran.append(("a", arm_world.simulation.step)))
    arm_world.loop.inbox.post(lambda: ran.append(("b", arm_world.simulation.step)))
    arm_world.loop.step(1)
    assert ran == [("a", 0), ("b", 0)]


def test_a_paused_loop_does_not_step_but_takes_posted_calls(arm_world):
    arm_world.loop.pause()
    ran = []
    arm_world.loop.inbox.post(lambda: ran.append(True))
    arm_world.loop.turn()
    assert ran == [True]
    assert arm_world.simulation.step == 0


def test_only_the_newest_message_of_a_command_stream_is_delivered(arm_world):
    got = []
    arm_world.host().create_subscription(String, "/command", got.append)
    for word in ("one", "two", "three"):
        arm_world.transport.send("/command", String(data=word))
    arm_world.loop.step(1)
    assert got == [String(data="three")]


def test_a_reset_restores_the_initial_state_bit_for_bit_and_keeps_time_going(arm_world):
    loop, data = arm_world.loop, arm_world.data
    loop.step(300)
    first = data.qpos.copy()
    loop.reset(Reset())
    assert arm_world.simulation.time_ns == 600_000_000
    assert data.time == pytest.approx(0.6)
    loop.step(300)
    assert np.array_equal(data.qpos, first)
    assert arm_world.simulation.epoch == 1
    assert arm_world.simulation.time_ns == 1_200_000_000


def test_a_reset_calls_every_stepper_once_before_the_reset_callbacks(arm_world):
    recorder, seen = Recorder(arm_world.simulation), []
    arm_world.loop.steppers.add(recorder)
    arm_world.loop.on_reset.append(lambda: seen.append((recorder.resets, arm_world.simulation.epoch)))
    arm_world.loop.reset(Reset())
    assert seen == [(1, 1)]


def test_the_run_can_be_stopped_from_the_inbox(arm_world):
    arm_world.loop.inbox.post(arm_world.loop.stop)
    arm_world.loop.run()
    assert arm_world.simulation.step <= 1


def test_a_handler_that_returns_what_is_no_response_hurts_only_its_client(arm_world, caplog):
    class Picky:
        request, parameters, refusals = String(), {}, []

        def respond(self, response):
            raise TypeError("not a response")

        def refuse(self, reason):
            self.refusals.append(reason)

    def slow():
        yield 2

    call = Picky()
    arm_world.loop.serve(call, lambda request, call: None)
    arm_world.loop.serve(call, lambda request, call: slow())
    arm_world.loop.step(5)
    assert call.refusals == ["internal error: TypeError('not a response')"] * 2
    assert arm_world.simulation.step == 5


def test_a_speed_factor_that_waits_for_centuries_is_fine(arm_model):
    world = World(arm_model, speed=1e-20)
    world.loop.inbox.post(lambda: world.loop.inbox.post(world.loop.stop))
    world.loop.run()
    assert world.simulation.step == 0


def test_a_flood_of_posted_calls_does_not_keep_steps_from_being_taken(arm_world):
    def again():
        arm_world.loop.inbox.post(again)

    for _ in range(5000):
        again()
    arm_world.loop.turn()
    assert arm_world.simulation.step > 0


def test_positions_that_a_call_writes_while_the_loop_waits_are_noticed(box_world):
    loop, data = box_world.loop, box_world.data

    def move():
        data.qpos[0] = 5.0

    loop.pause()
    box_world.simulation.kinematics()
    # It comes after the inbox has been looked at, so that it ends the wait.
    loop.on_idle.append(lambda: loop.inbox.post(move))
    loop.turn()
    box_world.simulation.kinematics()
    assert data.xpos[1, 0] == 5.0


@pytest.mark.parametrize("place", [0, 1, 2])
def test_when_one_update_fails_the_others_are_updated_once_in_that_step(box_world, place):
    data, loop = box_world.data, box_world.loop

    class Integrator:
        """Applies a force that grows with each of its updates."""

        def __init__(self, body):
            self.body, self.updates = body, 0

        def update(self):
            self.updates += 1
            data.xfrc_applied[self.body, 0] += self.updates
            loop.steppers.velocity_override[9 + self.body] = self.updates

        def on_reset(self):
            pass

    class Broken(Integrator):
        def update(self):
            if loop.simulation.step == 1:
                data.xfrc_applied[:] = 1000.0
                data.qfrc_applied[:] = 1000.0
                loop.steppers.velocity_override[:] = 7.0
                raise ZeroDivisionError

        def failed(self, error):
            pass

    healthy = [Integrator(1), Integrator(2)]
    for stepper in (*healthy[:place], Broken(0), *healthy[place:]):
        loop.steppers.add(stepper)
        loop.steppers.activate(stepper)
    seen = []
    advance = box_world.simulation.advance

    def spy(steps):
        seen.append((data.xfrc_applied[:, 0].tolist(), data.qfrc_applied.any(), data.qvel[10:12].tolist()))
        return advance(steps)

    box_world.simulation.advance = spy
    loop.step(3)
    assert seen == [([0.0, k, k, 0.0], False, [k, k]) for k in (1, 2, 3)]
    assert [stepper.updates for stepper in healthy] == [3, 3]


def test_in_a_flood_of_calls_active_steppers_get_as_much_time_as_the_calls(arm_world):
    """Each call posts itself again, so that the inbox is never empty."""
    recorder = Recorder(arm_world.simulation)
    arm_world.loop.steppers.add(recorder)
    arm_world.loop.steppers.activate(recorder)
    handled = []

    def again():
        handled.append(perf_counter())
        arm_world.loop.inbox.post(again)

    for _ in range(20_000):
        again()
    for _ in range(50):
        arm_world.loop.turn()
    assert arm_world.simulation.step > 2 * 50
    assert arm_world.loop.inbox.overruns > 0


@pytest.mark.parametrize("timestep", ["0.002", "0.3", "1000"])
def test_simulated_time_ends_with_a_sentence_at_the_latest_time_that_a_message_can_carry(timestep):
    text = f'<mujoco><option timestep="{timestep}" gravity="0 0 0"/><worldbody/></mujoco>'
    world = World(mujoco.MjModel.from_xml_string(text))
    world.loop.last_step -= 10
    world.simulation.step = world.loop.last_step
    world.loop.last_step += 10
    stamps = []
    world.host().create_timer(float(timestep), lambda: stamps.append(world.host().now()))
    world.loop.run()
    assert len(stamps) == 10
    assert 2**31 - 1 - float(timestep) < stamps[-1].to_ns() / 1e9 <= 2**31 - 1
    assert "simulated time has reached 2147483647 s" in str(world.loop.failure)


@pytest.mark.parametrize("timestep", ["1e-10", "1001", "1e300"])
def test_a_time_step_that_cannot_be_counted_is_refused(timestep):
    model = mujoco.MjModel.from_xml_string(f'<mujoco><option timestep="{timestep}"/><worldbody/></mujoco>')
    with pytest.raises(ModelError, match=r"the model's timestep is .* s; it must be between 1e-09 and 1000 s"):
        Simulation(model)


def test_a_step_waits_for_all_calls_that_were_posted_before_however_long_they_take(box_world, monkeypatch):
    monkeypatch.setattr(loop, "MAX_BATCH_TIME", 0.0)
    seen = []
    for _ in range(3):
        box_world.loop.inbox.post(lambda: seen.append(box_world.simulation.step))
    box_world.step()
    assert seen == [0, 0, 0]
