import mujoco
import numpy as np
import pytest
from conftest import BOX
from wrenches import Reference, push, request

from mjplug.testing import World
from mjplug_plugins.external_wrench import ExternalWrench
from mjplug_plugins.external_wrench.active import MAX_LOOPED
from mjplug_plugins.external_wrench.plugin import MAX_SHOWN
from mjplug_plugins.external_wrench.wrench import parse
from mjplug_schemas.visualization_msgs import Marker

SERVICE = "/external_wrench/apply_wrench"
DT = 0.002
BALL_Y = 7
"""Where the ball's velocity along y is in `qvel`; nothing is in its way, its mass is 1 kg, and its origin is its centre
of mass."""


@pytest.fixture
def world(box_model):
    world = World(box_model)
    world.add(ExternalWrench, "external_wrench")
    return world


def ask(world, *pushes):
    return world.call(SERVICE, request(*pushes))


def last_step_with_force(world, most=2000):
    """Takes steps until no wrench acts, and returns the number of the last one that felt any."""
    last = 0
    for _ in range(most):
        world.loop.step(1)
        if not world.data.xfrc_applied.any():
            break
        last = world.simulation.step
    return last


@pytest.mark.parametrize(("count", "seconds"), [(1, 1.0), (2, 1.0), (100, 0.1), (MAX_LOOPED + 1, 0.5), (1000, 0.1)])
def test_wrenches_of_one_request_that_end_together_give_exactly_their_impulse(world, count, seconds):
    call = ask(world, *[push("ball", force=(0, 1.0, 0), duration=seconds)] * count)
    steps = round(seconds / DT)
    world.loop.step(steps - 1)
    assert not call.answered
    world.loop.step(1)
    assert call.response.success
    world.loop.step(100)
    assert world.data.qvel[BALL_Y] == pytest.approx(count * seconds, rel=1e-12)


def test_several_wrenches_of_no_duration_act_for_one_step_all_of_them(world):
    call = ask(world, *[push("ball", force=(0, 1.0, 0))] * 5)
    world.loop.step(1)
    assert call.answered
    world.loop.step(10)
    assert world.data.qvel[BALL_Y] == pytest.approx(5.0 * DT, rel=1e-12)


def test_several_requests_that_end_at_the_same_step_are_answered_at_it(world):
    calls = []
    for start in (0, 10, 20):
        world.loop.step(start - world.simulation.step)
        both = [push("ball", force=(0, 1.0, 0), duration=(100 - start) * DT)] * 2
        calls.append(ask(world, *both))
    world.loop.step(79)
    assert [call.answered for call in calls] == [False] * 3
    world.loop.step(1)
    assert [call.answered for call in calls] == [True] * 3
    world.loop.step(50)
    assert world.data.qvel[BALL_Y] == pytest.approx(2 * (100 + 90 + 80) * DT, rel=1e-12)


def test_equal_durations_between_different_ones_end_at_their_own_steps(world):
    lengths = [3, 7, 7, 7, 1, 0, 3, 12]
    call = ask(world, *[push("ball", force=(0, 1.0, 0), duration=n * DT) for n in lengths])
    expected = 0.0
    for step in range(15):
        expected += DT * sum(step < max(n, 1) for n in lengths)
        world.loop.step(1)
        assert world.data.qvel[BALL_Y] == pytest.approx(expected, rel=1e-12)
        assert call.answered == (step >= 11)
    assert last_step_with_force(world) == 0


def test_ramps_that_end_together_follow_a_direct_computation(world):
    force, torque, point = np.array([3.0, 1.0, 0]), np.array([0, 0.2, 0.1]), np.array([0.1, 0, 0.05])
    ramps = [0.0, 0.1, 0.2, 0.1, 0.2]
    ask(world, *[push(force=force, torque=torque, point=point, duration=0.2, ramp=ramp) for ramp in ramps])
    reference = Reference()
    for k in range(150):
        remaining = 0.2 - k * DT
        scales = [0.0 if k >= 100 else 1.0 if not ramp else min(1.0, remaining / ramp) for ramp in ramps]
        reference.step(*[("box", force, torque, point, scale) for scale in scales])
        world.loop.step(1)
        assert np.allclose(world.data.qpos, reference.data.qpos, rtol=0, atol=1e-9)


def test_many_wrenches_give_the_bits_that_the_sum_of_each_gives(box_model):
    """The vectorised sum against `Wrench.apply`, with two bodies, ramps, wrenches that come and that end."""
    world, alone = World(box_model), World(mujoco.MjModel.from_xml_string(BOX))
    world.add(ExternalWrench, "external_wrench")
    random = np.random.default_rng(7)
    host, acting = alone.host("alone"), []
    for k in range(120):
        if k in (0, 5, 20):
            pushes = [
                push(
                    "ball" if i % 3 else "box",
                    force=random.normal(size=3),
                    torque=random.normal(size=3),
                    point=random.normal(size=3),
                    duration=(seconds := float(random.choice([0.0, 0.02, 0.0301, 0.1]))),
                    ramp=seconds * float(random.choice([0.0, 0.5, 1.0])),
                )
                for i in range(2 * MAX_LOOPED)
            ]
            ask(world, *pushes)
            acting += [parse(host, message) for message in pushes]
        alone.simulation.clear_forces()
        alone.simulation.kinematics()
        for wrench in acting:
            if alone.simulation.step < wrench.end:
                wrench.apply((alone.simulation.step - wrench.start) * DT)
        alone.simulation.checkpoint()
        alone.simulation.advance(1)
        world.loop.step(1)
        assert np.array_equal(world.data.qpos, alone.data.qpos)
        assert np.array_equal(world.data.qvel, alone.data.qvel)
    assert np.linalg.norm(world.data.qvel) > 1.0


def test_many_wrenches_add_to_what_another_plugin_applies(world):
    ask(world, *[push("ball", force=(0, 1.0, 0), duration=1.0)] * (MAX_LOOPED + 1))
    world.add(ExternalWrench, "another")
    world.call("/another/apply_wrench", request(push("ball", force=(0, 0.5, 0), duration=1.0)))
    world.loop.step(1)
    assert world.data.qvel[BALL_Y] == pytest.approx((MAX_LOOPED + 1.5) * DT, rel=1e-12)


def test_of_very_many_wrenches_only_some_have_arrows_and_these_are_taken_away(world):
    ask(world, *[push("ball", force=(0, 1.0, 0), duration=0.1)] * 300)
    world.loop.step(60)
    *shown, last = world.published("/external_wrench/wrench_markers")
    added = {marker.id for array in shown for marker in array.markers}
    assert len(added) == MAX_SHOWN
    assert {marker.id for marker in last.markers} == added
    assert {marker.action for marker in last.markers} == {Marker.DELETE}


def test_diagnostics_have_the_number_of_active_wrenches(world):
    def said():
        return world.diagnostics.diagnose()["external_wrench"]

    assert (said().message, said().values) == ("ok", {"active wrenches": "0"})
    ask(world, *[push("ball", force=(0, 1.0, 0), duration=0.1)] * 3)
    assert (said().message, said().values) == ("3 active", {"active wrenches": "3"})
    world.loop.step(50)
    assert said().values == {"active wrenches": "0"}
