"""Worlds that `~/step` steps, and requests to it."""

import numpy as np

from mjplug.services import clock, set_pause, step_simulation
from mjplug.services.stepping import service as stepping
from mjplug.testing import World
from mjplug_schemas.mjplug_msgs import Step

CARTS = """
<mujoco>
  <option timestep="0.002"/>
  <worldbody>
    <geom type="plane" size="5 5 .1"/>
    <body name="a" pos="0 0 1"><joint name="a" type="slide" axis="1 0 0"/><geom type="sphere" size=".1"/></body>
    <body name="b" pos="0 1 1"><joint name="b" type="slide" axis="1 0 0"/><geom type="sphere" size=".1"/></body>
    <body name="ball" pos="0 2 .1"><freejoint/><geom type="sphere" size=".1"/></body>
  </worldbody>
  <actuator><motor name="a" joint="a"/><motor name="b" joint="b" gear="2"/></actuator>
  <sensor><jointpos joint="a"/><actuatorfrc actuator="b"/></sensor>
</mujoco>
"""


def carts():
    """Returns a paused world with two carts and a ball, and the service `~/step`."""
    world = World(CARTS, paused=True)
    host = world.host("mjplug")
    set_pause.offer(host, world.loop)
    ownership = stepping.offer(host, world.loop, world.transport, world.topics, "mjplug")
    step_simulation.offer(host, world.loop, ownership)
    clock.offer(host, world.loop, rate=100.0)
    world.ownership = ownership
    return world


def send(world, owner="", **fields):
    parameters = {"owner": owner} if owner else {}
    return world.transport.call("/mjplug/step", Step.Request(**fields), **parameters)


def finish(world, call, turns=1000):
    for _ in range(turns):
        if call.answered:
            return call
        world.loop.inbox.post(lambda: None)
        world.loop.turn()
    raise AssertionError("the request was not answered")


def step(world, owner="", **fields):
    call = finish(world, send(world, owner, **fields))
    assert call.refusal is None, call.refusal
    return call.response


def refusal(world, owner="", **fields):
    before = world.simulation.step, world.data.ctrl.copy(), world.data.qpos.copy()
    call = finish(world, send(world, owner, **fields))
    assert call.refusal is not None
    assert world.simulation.step == before[0]
    assert np.array_equal(world.data.ctrl, before[1])
    assert np.array_equal(world.data.qpos, before[2])
    return call.refusal


def token(world, owner, present=True):
    world.transport.tokens["mjplug/@step/*"](f"mjplug/@step/{owner}", present)
    world.loop.step(0)
