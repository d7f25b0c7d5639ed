"""Timers in wall time, and the loop that runs them."""

from itertools import pairwise
from math import inf

import pytest

from mjplug.physics.wall_timers import WallTimers
from mjplug.testing import World


def test_a_timer_is_called_once_when_it_is_due_and_not_before():
    timers, called = WallTimers(), []
    timer = timers.create(called.append)
    assert timers.next_due == inf
    timer.set(2.0)
    assert timers.next_due == 2.0
    timers.run_due(1.9)
    assert called == []
    timers.run_due(2.0)
    timers.run_due(3.0)
    assert called == [2.0]
    assert timers.next_due == inf


def test_a_timer_may_be_set_again_by_its_own_call_and_turned_off():
    timers, called = WallTimers(), []

    def call(now):
        called.append(now)
        timer.set(now + 1.0)

    timer = timers.create(call)
    timer.set(0.0)
    for now in (0.0, 0.5, 1.0, 2.5, 3.0):
        timers.run_due(now)
    assert called == [0.0, 1.0, 2.5]
    assert timers.next_due == 3.5
    timer.stop()
    assert timers.next_due == inf


def test_the_earliest_of_several_timers_counts():
    timers, called = WallTimers(), []
    first, second = (
        timers.create(lambda now: called.append("first")),
        timers.create(lambda now: called.append("second")),
    )
    first.set(5.0)
    second.set(4.0)
    assert timers.next_due == 4.0
    timers.run_due(4.5)
    assert (called, timers.next_due) == (["second"], 5.0)


@pytest.mark.parametrize("paused", [True, False])
@pytest.mark.parametrize("speed", [0.001, 1.0, "max"])
def test_the_loop_runs_timers_at_any_speed_and_while_paused(paused, speed):
    world = World(paused=paused, speed=speed)
    times = []

    def call(now):
        times.append(now)
        if len(times) == 5:
            world.loop.stop()
        timer.set(now + 0.005)

    timer = world.loop.wall_timers.create(call)
    timer.set(0.0)
    world.loop.run()
    assert len(times) == 5
    assert all(later - earlier >= 0.005 for earlier, later in pairwise(times))
