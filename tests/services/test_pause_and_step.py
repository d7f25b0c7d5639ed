import mujoco
import numpy as np
import pytest

from mjplug.physics.reset import Reset
from mjplug.services import clock, set_pause, step_simulation
from mjplug.services.stepping.ownership import Ownership
from mjplug.testing import World
from mjplug_schemas.mujoco_ros2_control_msgs import SetPause, StepSimulation


@pytest.fixture
def world(arm_model):
    world = World(arm_model)
    host = world.host("mjplug")
    set_pause.offer(host, world.loop)
    step_simulation.offer(host, world.loop, Ownership("mjplug/@step"))
    clock.offer(host, world.loop, rate=100.0)
    return world


def pause(world, paused=True):
    return world.call("/mjplug/set_pause", SetPause.Request(paused=paused)).response


def step(world, steps):
    return world.call("/mjplug/step_simulation", StepSimulation.Request(steps=steps))


def test_pausing_and_resuming_answer_with_the_new_state(world):
    assert pause(world) == SetPause.Response(success=True, message="the simulation is now paused")
    assert world.loop.paused
    assert pause(world) == SetPause.Response(success=True, message="the simulation is already paused")
    assert pause(world, False) == SetPause.Response(success=True, message="the simulation is now running")
    assert not world.loop.paused
    assert pause(world, False) == SetPause.Response(success=True, message="the simulation is already running")


def test_n_steps_from_pause_are_exactly_n_steps(world, arm_model):
    pause(world)
    call = step(world, 1234)
    while not call.answered:
        world.loop.turn()
    data = mujoco.MjData(arm_model)
    for _ in range(1234):
        mujoco.mj_step(arm_model, data)
    assert np.array_equal(world.data.qpos, data.qpos)
    assert world.simulation.step == 1234
    assert world.loop.paused
    assert call.response == StepSimulation.Response(success=True, message="took 1234 steps; t = 2.468000 s")


def test_step_requests_add_up_and_each_is_answered_at_its_own_last_step(world):
    pause(world)
    first, second = step(world, 10), step(world, 5)
    reached = {}
    while not second.answered:
        world.loop.turn()
        for name, call in (("first", first), ("second", second)):
            if call.answered:
                reached.setdefault(name, world.simulation.step)
    assert first.response.success
    assert second.response.success
    assert world.simulation.step == 15


def test_steps_do_not_include_those_of_a_request_before_that_ended_early(world):
    pause(world)
    goals = world.loop.goals
    goals.add(0, 1_000_000)
    ended = goals.add(world.simulation.step, 5000)
    second, third = step(world, 10), step(world, 3)
    world.loop.turn()
    goals.remove(ended)
    taken = world.simulation.step
    assert 0 < taken < 1_000_000
    assert not second.answered
    goals.remove(goals.first)
    while not third.answered:
        world.loop.turn()
    assert second.response.success
    assert world.simulation.step == taken + 13
    assert not goals


def test_steps_are_refused_while_running_and_when_zero(world):
    assert step(world, 5).refusal == "the simulation is running; pause it first (~/set_pause, or mjplug sim pause)"
    pause(world)
    assert step(world, 0).refusal == "steps is 0; it must be at least 1"


def test_resuming_interrupts_steps_under_way(world):
    pause(world)
    call = step(world, 1_000_000_000)
    world.loop.turn()
    pause(world, False)
    taken = world.simulation.step
    assert call.refusal == f"interrupted: the simulation was resumed ({taken} of 1000000000 steps were taken)"


def test_a_reset_answers_steps_under_way(world):
    pause(world)
    call = step(world, 1_000_000_000)
    world.loop.turn()
    world.loop.reset(Reset())
    assert call.refusal.startswith("cancelled: the world was reset")
    assert call.answers == 1
    before = world.simulation.step
    world.loop.inbox.post(lambda: None)
    world.loop.turn()
    assert world.simulation.step == before


def test_the_clock_ticks_at_its_rate_while_running(world):
    world.loop.step(50)
    stamps = [m.clock.to_ns() for m in world.published("/clock")]
    assert stamps == [k * 10_000_000 for k in range(1, 11)]


def test_the_clock_ticks_after_every_single_step(world):
    pause(world)
    for _ in range(3):
        call = step(world, 1)
        while not call.answered:
            world.loop.turn()
    assert [m.clock.to_ns() for m in world.published("/clock")] == [2_000_000, 4_000_000, 6_000_000]


def test_the_clock_ticks_and_the_epoch_counts_at_a_reset(world):
    world.loop.step(3)
    world.loop.reset(Reset())
    assert [m.clock.to_ns() for m in world.published("/clock")] == [6_000_000]
    assert [m.data for m in world.published("/mjplug/epoch")] == [0, 1]


def test_a_first_listener_gets_the_time_at_once_while_paused(world):
    pause(world)
    world.transport.publishers["/clock"].on_matched()
    world.loop.step(0)
    assert [m.clock.to_ns() for m in world.published("/clock")] == [0]


def test_while_paused_the_time_is_repeated_for_those_who_join_later(world):
    world.loop.step(3)
    pause(world)
    world.loop.on_idle.append(lambda: world.loop.inbox.post(lambda: None))
    world.loop.turn()
    assert [m.clock.to_ns() for m in world.published("/clock")] == [6_000_000]


def test_asking_for_pause_gives_up_the_steps_under_way(world):
    pause(world)
    first, second = step(world, 1_000_000_000), step(world, 5)
    world.loop.turn()
    taken = world.simulation.step
    assert pause(world).message == "the simulation is paused; the running step_simulation was cancelled"
    assert first.refusal == f"interrupted: the simulation was paused ({taken} of 1000000000 steps were taken)"
    assert second.refusal == "interrupted: the simulation was paused (0 of 5 steps were taken)"
