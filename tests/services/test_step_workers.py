"""`~/step`: samples that a worker process publishes."""

import numpy as np
import pytest
from step_worlds import carts, finish, refusal, send, step

from mjplug.services.stepping import service as stepping
from mjplug.testing import World
from mjplug_plugins.lidar import Lidar
from mjplug_schemas.sensor_msgs import LaserScan


@pytest.fixture
def world():
    return carts()


def test_a_worker_that_works_on_the_last_state_delays_the_answer(world):
    call = send(world, steps=5)
    world.host("camera").create_timer(0.01, lambda: world.loop.lockstep.add("camera"))
    for _ in range(20):
        world.loop.inbox.post(lambda: None)
        world.loop.turn()
    assert world.simulation.step == 5
    assert not call.answered
    world.loop.inbox.post(lambda: world.loop.lockstep.discard("camera"))
    assert finish(world, call).response.step == 5


EYE = """
<mujoco>
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <geom type="box" size=".1 9 9" pos="5 0 0"/>
    <body name="carrier"><joint name="x" type="slide" axis="1 0 0"/><geom size=".2"/><site name="eye"/></body>
  </worldbody>
  <actuator><velocity joint="x" kv="1000"/></actuator>
</mujoco>
"""


def scanner(sync, **parameters):
    world = World(EYE, paused=True)
    host = world.host("mjplug")
    world.ownership = stepping.offer(host, world.loop, world.transport, world.topics, "mjplug")
    settings = {"site": "eye", "resolution": (8, 1), "azimuth_range": (-0.4, 0.4), "elevation_range": (0.0,)}
    settings |= {"max_range": 100.0, "update_rate": 10.0, "frame_name": "eye", "topic": "/scan"}
    world.add(Lidar, "lidar", sync=sync, front=settings, **parameters)
    return world


def test_a_scan_belongs_to_exactly_the_last_boundary():
    world = scanner(sync=True)
    for steps in (3, 50, 7):
        response = step(world, steps=steps, ctrl=[0.5], outputs=["/scan"], observe=["qpos"])
        (sample,) = response.outputs
        scan = LaserScan.from_cdr(sample.cdr)
        assert sample.fresh
        assert scan.header.stamp == response.stamp
        distance = (4.9 - response.observations[0]) / np.cos(scan.angle_min)
        assert scan.ranges[0] == pytest.approx(distance, rel=1e-6)
    # At rest, and without an action.
    (again,) = step(world, steps=0, outputs=["/scan", "/scan"][:1]).outputs
    assert again == sample


def test_a_scan_for_which_physics_does_not_wait_is_refused():
    reason = refusal(scanner(sync=False), outputs=["/scan"], ctrl=[1.0])
    assert reason == (
        "outputs[0] (/scan): a worker process publishes it, and physics does not wait for it; set its plugin's sync"
    )


def test_a_scan_that_is_lost_is_reported():
    world = scanner(sync=True)
    worker = world.workers.workers["lidar"]
    worker.hold()
    call = send(world, steps=2, outputs=["/scan"])
    for _ in range(5):
        world.loop.inbox.post(lambda: None)
        world.loop.turn()
    (job, _), worker._waiting = worker._waiting, None
    worker.spec.on_lost(job.tasks, "the process was killed")
    assert finish(world, call).refusal == "no sample of /scan: the process was killed; all steps were taken"
