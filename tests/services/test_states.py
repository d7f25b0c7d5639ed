"""Saved states: what is published after a restore is what was published after the save, byte by byte."""

import itertools
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from joint_robots import compiled
from state_worlds import StateWorld, scene
from wrenches import push

from mjplug.physics import physics_state
from mjplug.physics.reset import Reset
from mjplug.services import clock, step_simulation
from mjplug.services.stepping.ownership import Ownership
from mjplug_schemas.mjplug_msgs import (
    SaveState,
)
from mjplug_schemas.mujoco_ros2_control_msgs import StepSimulation
from mjplug_schemas.std_msgs import String

SCRIPT = Path(__file__).parents[1] / "state_worlds.py"


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    """A world with a state `s` in memory and in a file, and what follows it."""
    folder = tmp_path_factory.mktemp("states")
    world = StateWorld(folder)
    world.prepare()
    world.save()
    world.save(file=True)
    world.expected = world.run()
    world.folder = folder
    yield world
    world.close()


def test_the_state_is_in_the_middle_of_everything(prepared):
    world = StateWorld(prepared.folder)
    world.prepare()
    assert world.data.ncon > 4
    brick, top = world.wrench._active.looped
    assert 0 < brick.scale((151 - brick.start) * 0.002) < 1
    assert top.scale((151 - top.start) * 0.002) == 1
    (bank,) = world.joints._joints.banks
    assert np.abs(bank.save()["integral"]).min() > 0.1
    assert world.joints._trajectories.running
    due = [timer.due - 151 for part in world.loop.parts for timer in part.timers.values()]
    assert len(set(due)) > 4
    numbers = [count for count, _ in prepared.expected[1].values()]
    assert sum(number > 10 for number in numbers) == 8


@pytest.mark.parametrize(("file", "strict"), [(False, True), (True, False)])
def test_a_restored_state_continues_as_it_did(prepared, file, strict):
    for _ in range(2):
        answer = prepared.restore(file=file, strict=strict)
        assert (prepared.simulation.step, prepared.data.time) == (151, sum(itertools.repeat(0.002, 151)))
        assert answer.snapshot.left_out == ()
        assert prepared.run() == prepared.expected


def test_another_server_continues_from_the_file(prepared):
    world = StateWorld(prepared.folder)
    # It has a history of its own.
    world.push(push("top", (1, 0, 3), duration=3.0))
    world.step(77)
    world.restore(file=True, strict=True)
    assert world.run() == prepared.expected
    world.close()


@pytest.mark.slow
def test_another_process_continues_after_the_first_one_was_killed(tmp_path, prepared):
    first = subprocess.Popen([sys.executable, SCRIPT, "save", tmp_path, "1000"], stdout=subprocess.PIPE, text=True)
    try:
        expected = first.stdout.readline()
        os.kill(first.pid, signal.SIGKILL)
    finally:
        first.kill()
        first.wait()
        first.stdout.close()
    second = subprocess.run(
        [sys.executable, SCRIPT, "restore", tmp_path, "1000"], capture_output=True, text=True, check=True
    )
    assert second.stdout == expected == f"{prepared.expected!r}\n"


@pytest.mark.parametrize("steps", [0, 1, 2, 5, 37, 250])
def test_any_step_can_be_saved(steps):
    world = StateWorld()
    world.prepare(steps)
    world.save()
    expected = world.run(300)
    world.restore(strict=True)
    assert world.run(300) == expected


def test_bodies_that_sleep_are_restored():
    world = StateWorld(model=compiled(scene(sleep=True)), plugins=False)
    world.step(2500)
    assert (world.data.tree_asleep >= 0).any()
    assert (world.data.tree_asleep < 0).any()
    world.save()

    def wake():
        world.data.qvel[world.model.body_dofadr[world.simulation.body_id("ball")] + 2] = 3.0
        results = [world.step(400) or world.data.tree_asleep.tolist() for _ in range(5)]
        return results, world.digest()

    expected = wake()
    world.restore()
    assert wake() == expected


def test_the_results_of_the_last_step_are_restored():
    world = StateWorld(plugins=False)
    world.data.ctrl[:] = 0.3, -0.2, 0.1
    world.step(60)
    names = ("sensordata", "qacc", "actuator_force", "qfrc_constraint", "cfrc_ext", "xpos")
    before = {name: getattr(world.data, name).copy() for name in names}
    world.save()
    world.step(100)
    world.restore()
    for name, array in before.items():
        assert array.any(), name
        assert np.array_equal(getattr(world.data, name), array), name
    assert world.simulation.sensor_step == 59


def test_time_can_continue():
    world = StateWorld()
    world.prepare()
    world.save()
    world.step(500)
    position = world.data.qpos.copy()
    answer = world.restore(keep_time=True, strict=True)
    assert (world.simulation.step, world.data.time) == (651, 1.302)
    assert "t = 1.302000 s (step 651)" in answer.message
    assert not np.array_equal(world.data.qpos, position)
    # The wrench has the same rest of its ramp, and timers the same rest of their periods.
    (brick, _) = world.wrench._active.looped
    assert (brick.start, brick.end) == (500, 950)
    world.clear()
    world.step(300)
    kept = {name: count for name, (count, _) in world.told().items()}
    world.restore(strict=True)
    digest, told = world.run(300)
    assert kept == {name: count for name, (count, _) in told.items()}
    world.restore(keep_time=True)
    world.step(300)
    assert world.digest() != digest, "the digest contains the time"


def test_the_epoch_grows_and_the_clock_is_published():
    world = StateWorld(plugins=False)
    clock.offer(world.host("other"), world.loop, 100.0)
    world.step(100)
    world.save()
    world.step(900)
    world.clear()
    world.restore()
    assert world.simulation.epoch == 1
    assert [message.data for message in world.published("/other/epoch")] == [1]
    assert [message.clock.to_ns() for message in world.published("/clock")] == [200_000_000]
    world.restore()
    assert world.simulation.epoch == 2


def test_noise_is_that_of_the_saved_past_and_a_reset_draws_new_noise():
    world = StateWorld()
    world.loop.reset(Reset())
    world.prepare()
    world.save()
    first = world.run(100)[1]["/sensors/arm/imu"]
    world.restore()
    assert world.run(100)[1]["/sensors/arm/imu"] == first
    world.loop.reset(Reset())
    assert (world.simulation.epoch, world.simulation.lineage) == (3, 2)
    world.restore()
    assert (world.simulation.epoch, world.simulation.lineage) == (4, 1)
    assert world.run(100)[1]["/sensors/arm/imu"] == first


def test_waiting_requests_are_refused_and_their_wrenches_end():
    world = StateWorld()
    step_simulation.offer(world.host("mjplug"), world.loop, Ownership("mjplug/@step"))
    world.step(10)
    world.save()
    wrench = world.push(push("top", (0, 0, 9), duration=2.0))
    steps = world.call("/mjplug/step_simulation", StepSimulation.Request(steps=5000))
    world.step(3)
    world.restore(strict=True)
    assert wrench.refusal == "cancelled: a state was restored"
    assert steps.refusal.startswith("cancelled: a state was restored")
    assert len(world.wrench._active) == 0
    world.step(1)
    assert not world.data.xfrc_applied.any()


def test_the_client_of_a_wrench_only_observes_it():
    world = StateWorld()
    call = world.push(push("top", (0, 0, 9), duration=0.02))
    world.step(4)
    world.save()
    world.step(6)
    assert call.response.success
    world.restore()
    (wrench,) = world.wrench._active.looped
    assert wrench.end == 10
    world.step(5)
    assert world.data.xfrc_applied.any()
    world.step(1)
    assert not world.data.xfrc_applied.any()
    assert call.answers == 1


def test_more_wrenches_than_the_loop_takes_are_restored():
    world = StateWorld()
    for number in range(40):
        world.push(push("top", (0.1 * number, 1, 0), duration=0.1 + 0.01 * number, ramp=0.1))
    world.step(20)
    world.save()
    expected = world.run(300)
    world.restore(strict=True)
    assert world.run(300) == expected


def test_a_sleeping_timer_wakes_in_its_phase_after_a_restore():
    world = StateWorld(plugins=False)
    host, fired = world.host("timers"), []
    publisher = host.create_publisher(String, "~/text")
    publisher.matched = False
    host.create_timer(0.02, lambda: fired.append(host.step), while_matched=publisher)
    world.step(33)
    world.save()
    world.step(100)
    publisher.matched = True
    world.restore()
    world.step(30)
    assert fired == [40, 50, 60]


def test_a_timer_that_is_due_at_the_saved_step_fires_once_after_a_restore():
    world = StateWorld(plugins=False)
    host, fired = world.host("timers"), []
    host.create_timer(0.02, lambda: fired.append(host.step))
    calls = []
    # Created later, so it posts the request after the timer above has fired at step 9, and before step 10.
    timer = host.create_timer(0.002, lambda: None)
    advance = world.simulation.advance

    def advance_and_request(steps):
        found = advance(steps)
        if world.simulation.step == 10 and not calls:
            calls.append(world.transport.call("/mjplug/save_state", SaveState.Request(name="s")))
            # The loop handles the request before the timers of this boundary.
            world.loop.inbox.drain(1.0)
        return found

    world.simulation.advance = advance_and_request
    world.step(12)
    timer.cancel()
    assert calls[0].response.snapshot.step == 10
    assert fired == [10]
    world.restore()
    world.step(10)
    assert fired == [10, 10, 20]


def test_a_simulation_of_nothing_can_be_saved():
    world = StateWorld(model=compiled("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>"), plugins=False)
    world.step(3)
    world.save()
    world.step(3)
    world.restore()
    assert (world.simulation.step, world.data.time) == (3, 0.006)


def test_forces_without_an_update_are_state():
    world = StateWorld(plugins=False)
    world.data.xfrc_applied[5, 2] = 2.0
    world.step(5)
    world.save()
    expected = world.run(50)
    world.restore()
    assert world.data.xfrc_applied[5, 2] == 2.0
    assert world.run(50) == expected


def test_the_results_are_those_arrays_that_do_not_move_in_memory():
    world = StateWorld(plugins=False)
    world.step(200)
    arrays = physics_state.result_arrays(world.data)
    places = {name: array.ctypes.data for name, array in arrays.items()}
    world.loop.reset(Reset())
    world.step(1)
    assert places == {name: array.ctypes.data for name, array in physics_state.result_arrays(world.data).items()}
    assert {"sensordata", "qacc", "xpos", "qfrc_actuator"} <= places.keys()
    assert not any(name.startswith(("efc_", "qpos", "qvel", "contact")) for name in places)
