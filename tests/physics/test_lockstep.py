"""Simulated time that waits for a worker process: no step is taken, and everything else goes on."""

import numpy as np
import pytest

from mjplug.physics.reset import Reset
from mjplug.services import clock, set_pause, step_simulation
from mjplug.services.stepping.ownership import Ownership
from mjplug.testing import World
from mjplug_schemas.mujoco_ros2_control_msgs import SetPause, StepSimulation


class Camera:
    """Requests an image every 10 ms and waits for it; the test decides when the image is ready."""

    def __init__(self, world):
        self.world = world
        self.asked = []
        host = world.host("camera")
        host.create_timer(0.01, self._ask)

    def _ask(self):
        self.asked.append(self.world.simulation.step)
        self.world.loop.lockstep.add(self)

    def deliver(self):
        self.world.loop.inbox.post(lambda: self.world.loop.lockstep.discard(self))


@pytest.fixture
def world(arm_model):
    world = World(arm_model)
    host = world.host("mjplug")
    set_pause.offer(host, world.loop)
    step_simulation.offer(host, world.loop, Ownership("mjplug/@step"))
    clock.offer(host, world.loop, rate=100.0)
    world.loop.paused = True
    return world


def turns(world, count):
    """Lets the loop turn without waiting for the clock of the wall."""
    for _ in range(count):
        world.loop.inbox.post(lambda: None)
        world.loop.turn()


def step(world, steps):
    return world.call("/mjplug/step_simulation", StepSimulation.Request(steps=steps))


def set_paused(world, paused):
    return world.call("/mjplug/set_pause", SetPause.Request(paused=paused))


def test_no_step_is_taken_until_the_image_is_there(world):
    camera = Camera(world)
    set_paused(world, False)
    turns(world, 20)
    assert (world.simulation.step, camera.asked) == (5, [5])
    camera.deliver()
    turns(world, 20)
    assert (world.simulation.step, camera.asked) == (10, [5, 10])


def test_requests_are_answered_meanwhile(world):
    Camera(world)
    set_paused(world, False)
    turns(world, 10)
    paused = set_paused(world, True)
    turns(world, 1)
    assert paused.response.success
    assert world.loop.paused
    state = world.data.qpos.copy()
    turns(world, 10)
    assert np.array_equal(world.data.qpos, state)


def test_step_simulation_is_answered_after_the_images_of_its_last_step(world):
    camera = Camera(world)
    call = step(world, 5)
    turns(world, 20)
    assert world.simulation.step == 5
    assert not call.answered
    camera.deliver()
    turns(world, 2)
    assert call.response.success
    assert world.simulation.step == 5


def test_a_reset_is_carried_out_meanwhile(world):
    camera = Camera(world)
    call = step(world, 50)
    turns(world, 10)
    world.loop.inbox.post(lambda: world.loop.reset(Reset()))
    turns(world, 2)
    assert world.simulation.epoch == 1
    assert call.refusal == "cancelled: the world was reset (5 of 50 steps were taken)"
    camera.deliver()
    again = step(world, 4)
    turns(world, 10)
    assert again.response.success


def test_a_stop_ends_the_wait(world):
    Camera(world)
    world.loop.paused = False
    world.loop.on_second.append(lambda now: world.loop.lockstep and world.loop.inbox.post(world.loop.stop))
    world.loop.run()
    assert world.simulation.step == 5


def test_a_run_of_a_given_length_ends_when_its_last_image_is_there(world):
    camera = Camera(world)
    world.loop.paused = False
    world.loop.last_step = 5
    stopped = []
    world.loop.on_second.append(lambda now: stopped.append(now) or camera.deliver())
    world.loop.run()
    assert stopped
    assert world.simulation.step == 5
    assert not world.loop.lockstep


def test_stepping_by_hand_waits_for_images_between_steps(world):
    camera = Camera(world)
    # After the camera's own timer, at the same step.
    world.host("other").create_timer(0.01, camera.deliver)
    world.loop.step(12)
    assert (world.simulation.step, camera.asked) == (12, [5, 10])


def test_an_image_requested_in_an_update_blocks_the_step_after_the_next(world):
    loop, updates = world.loop, []

    class Active:
        def update(self):
            updates.append(world.simulation.step)
            if world.simulation.step == 3:
                loop.lockstep.add(self)

        def on_reset(self):
            pass

    active = Active()
    loop.steppers.add(active)
    loop.steppers.activate(active)
    call = step(world, 10)
    turns(world, 20)
    assert (updates, world.simulation.step) == ([0, 1, 2, 3], 4)
    assert not call.answered
    loop.inbox.post(lambda: loop.lockstep.discard(active))
    turns(world, 20)
    assert updates == list(range(10))
    assert call.response.success
