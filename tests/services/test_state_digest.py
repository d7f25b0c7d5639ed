"""The state after a driven run does not depend on how its steps were taken, nor on who subscribes."""

import math

import pytest
from state_worlds import StateWorld
from wrenches import push, request

from mjplug.plugin import Host, Parameters, Plugin
from mjplug.server.local_calls import LocalCall
from mjplug_schemas.builtin_interfaces import Duration
from mjplug_schemas.geometry_msgs import Twist, Vector3
from mjplug_schemas.trajectory_msgs import JointTrajectory, JointTrajectoryPoint

STEPS = 600


class Driver(Plugin[Parameters]):
    """Gives commands at certain steps; messages of a client would be handled at any step."""

    stateless = True
    world: StateWorld

    def init(self, host: Host, parameters: Parameters) -> None:
        self.host = host
        self.number = 0
        host.create_timer(0.11, self.command)

    def command(self) -> None:
        world, number = self.world, self.number
        self.number += 1
        turn = math.sin(number)
        trajectories = world.joints._trajectories
        message = JointTrajectory(
            joint_names=["elbow"],
            points=[JointTrajectoryPoint(positions=[turn], time_from_start=Duration(nanosec=90_000_000))],
        )
        trajectories.start(trajectories.checked(message))
        world.joints._wake()
        world.drive._handle(Twist(linear=Vector3(x=turn), angular=Vector3(z=0.3)))
        world.data.ctrl[1] = 0.4 * turn
        world.data.mocap_pos[0, 2] += 0.001
        if number % 3 == 0:
            wrench = LocalCall(request(push("top", (turn, 1, 3), duration=0.15, ramp=0.1)))
            world.loop.serve(wrench, world.wrench._apply)


def driven(speed="max", matched=True):
    world = StateWorld(speed=speed)
    world.add(type("DriverOfWorld", (Driver,), {"world": world}), "driver")
    for publisher in world.transport.publishers.values():
        publisher.matched = matched
    return world


def digest_after(world, steps):
    assert world.simulation.step == steps
    (integral,) = (bank.save()["integral"].tobytes() for bank in world.joints._joints.banks)
    return world.digest(), integral


def run(speed, steps, matched=True):
    """Runs as the server does."""
    world = driven(speed, matched)
    world.loop.last_step = steps
    world.loop.resume()
    world.loop.run()
    world.loop.pause()
    return digest_after(world, steps)


def step(sizes, steps, matched=True):
    world = driven(matched=matched)
    taken = 0
    for size in sizes(steps):
        world.step(size)
        taken += size
    return digest_after(world, taken)


def singly(steps):
    return [1] * steps


def in_batches(steps):
    sizes = [37] * (steps // 37)
    return [*sizes, steps - sum(sizes)]


def at_once(steps):
    return [steps]


def test_the_state_depends_on_the_steps_only():
    expected = run("max", STEPS)
    assert run(5.0, STEPS) == expected
    assert run("max", STEPS, matched=False) == expected
    for sizes in (singly, in_batches, at_once):
        assert step(sizes, STEPS) == expected
    assert step(singly, STEPS, matched=False) == expected


@pytest.mark.slow
def test_the_state_after_a_long_run_depends_on_the_steps_only():
    steps = 10_000
    expected = run("max", steps)
    for speed in (1.0, 5.0):
        assert run(speed, steps) == expected
    assert run("max", steps, matched=False) == expected
    for sizes in (singly, in_batches, at_once):
        assert step(sizes, steps) == expected
        assert step(sizes, steps, matched=False) == expected
