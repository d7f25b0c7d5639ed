import itertools
import math

import mujoco
import numpy as np
import pytest
from conftest import BOX
from wrenches import Reference, push, request

from mjplug.physics.reset import Reset
from mjplug.testing import World
from mjplug_plugins.external_wrench import ExternalWrench
from mjplug_schemas.mujoco_ros2_control_msgs import ApplyExternalWrench
from mjplug_schemas.visualization_msgs import Marker

SERVICE, MARKERS = "/external_wrench/apply_wrench", "/external_wrench/wrench_markers"
DT = 0.002


@pytest.fixture
def world(box_model):
    world = World(box_model)
    world.add(ExternalWrench, "external_wrench")
    return world


def ask(world, *pushes, **parameters):
    return world.call(SERVICE, request(*pushes), **parameters)


def steps_until_answer(world, call, most=10_000):
    start = world.simulation.step
    while not call.answered and world.simulation.step - start < most:
        world.loop.step(1)
    return world.simulation.step - start


def test_ten_newtons_for_two_seconds_at_an_offset_with_a_ramp_follow_a_direct_computation(world):
    force, torque, point = np.array([10.0, 0, 0]), np.array([0, 0.3, 0.1]), np.array([0.1, 0.02, 0])
    call = ask(world, push(force=force, torque=torque, point=point, duration=2.0, ramp=0.5))
    reference = Reference()
    for k in range(1200):
        remaining = 2.0 - k * DT
        scale = 0.0 if k >= 1000 else min(1.0, remaining / 0.5)
        reference.step(("box", force, torque, point, scale))
        world.loop.step(1)
        assert np.allclose(world.data.qpos, reference.data.qpos, rtol=0, atol=1e-9)
        assert call.answered == (k >= 999)
    assert call.response == ApplyExternalWrench.Response(success=True, message="applied 1 wrench, the longest for 2 s")
    assert np.linalg.norm(world.data.qvel[3:6]) > 1.0


def test_a_body_s_spin_turns_the_force_at_every_step(world):
    """With constant spin and the force through the centre of mass, the impulse has a closed form."""
    com = world.model.body("ball").ipos
    dof = int(world.model.joint(1).dofadr[0])
    omega, seconds = 3.0, 0.5
    world.data.qvel[dof + 5] = omega
    ask(world, push("ball", force=(2.0, 0, 0), point=com, duration=seconds))
    world.loop.step(250)
    # Velocity after n steps: sum of F/m dt (cos wt, sin wt) at the start of each step.
    phase = omega * DT * np.arange(250)
    assert world.data.qvel[dof] == pytest.approx(2.0 * DT * np.cos(phase).sum(), abs=1e-9)
    assert world.data.qvel[dof + 1] == pytest.approx(2.0 * DT * np.sin(phase).sum(), abs=1e-9)


def test_zero_duration_is_exactly_one_step(world):
    call = ask(world, push(force=(4.0, 0, 0), point=world.model.body("box").ipos))
    assert steps_until_answer(world, call) == 1
    world.loop.step(10)
    assert world.data.qvel[0] == pytest.approx(4.0 / 2.0 * DT, abs=1e-15)


def test_a_duration_between_steps_is_rounded_up(world):
    assert steps_until_answer(world, ask(world, push(force=(1, 0, 0), duration=0.0101))) == 6
    assert steps_until_answer(world, ask(world, push(force=(1, 0, 0), duration=0.01))) == 5


def test_four_overlapping_wrenches_add_up_and_end_at_exactly_their_steps(world):
    com = world.model.body("box").ipos
    reference, calls, ends = Reference(), {}, {}
    forces = [(1, 0, 0), (2, 1, 0), (0, -3, 1), (0, 0, 5)]
    starts, lengths = [0, 10, 20, 30], [100, 50, 200, 3]
    for k in range(300):
        for i, start in enumerate(starts):
            if k == start:
                calls[i] = ask(world, push(force=forces[i], point=com, duration=lengths[i] * DT))
        active = [
            ("box", np.array(f, float), np.zeros(3), com, 1.0)
            for f, s, n in zip(forces, starts, lengths, strict=True)
            if s <= k < s + n
        ]
        reference.step(*active)
        world.loop.step(1)
        for i, call in calls.items():
            if call.answered:
                ends.setdefault(i, world.simulation.step)
        assert np.allclose(world.data.qpos, reference.data.qpos, rtol=0, atol=1e-9)
    assert ends == {i: s + n for i, (s, n) in enumerate(zip(starts, lengths, strict=True))}
    assert not world.data.xfrc_applied.any()


def test_wrenches_of_one_request_end_independently_and_the_answer_waits_for_the_longest(world):
    com = world.model.body("box").ipos
    call = ask(world, push(force=(2, 0, 0), point=com, duration=0.01), push("ball", force=(0, 3, 0), duration=0.05))
    assert steps_until_answer(world, call) == 25
    dof = int(world.model.joint(1).dofadr[0])
    assert world.data.qvel[dof + 1] == pytest.approx(3.0 * 0.05, abs=1e-12)
    assert world.data.qvel[0] == pytest.approx(2.0 / 2.0 * 0.01, abs=1e-12)


def test_the_same_run_twice_is_bit_identical(box_model):
    def run():
        world = World(box_model)
        world.add(ExternalWrench, "external_wrench")
        ask(world, push(force=(10, 2, 1), torque=(0.1, 0.2, 0.3), point=(0.1, 0, 0), duration=0.5, ramp=0.2))
        world.loop.step(1000)
        return world.data.qpos.copy(), world.data.qvel.copy()

    first, second = run(), run()
    assert np.array_equal(first[0], second[0])
    assert np.array_equal(first[1], second[1])


def test_a_wrench_asked_for_while_paused_begins_with_the_first_step(world):
    world.loop.pause()
    call = ask(world, push(force=(1, 0, 0), duration=0.01))
    world.loop.inbox.post(lambda: None)
    world.loop.turn()
    assert not call.answered
    assert steps_until_answer(world, call) == 5


def test_with_wait_false_the_answer_comes_at_once_and_the_wrench_still_acts(world):
    call = ask(world, push(force=(2, 0, 0), point=world.model.body("box").ipos, duration=0.1), wait="false")
    assert call.response.success
    assert call.response.message == "applying 1 wrench, the longest for 0.1 s"
    world.loop.step(100)
    assert world.data.qvel[0] == pytest.approx(0.1, abs=1e-12)


def test_no_wrench_is_a_success_that_does_nothing(world):
    assert ask(world).response.message == "the request contains no wrench; nothing was applied"
    world.loop.step(1)
    assert not world.data.qvel.any()


KNOWN = "known: ball, box, post, world"
REFUSED = [
    (push("boxx"), f"unknown body 'boxx', did you mean 'box'?; {KNOWN}"),
    (push(""), f"unknown body ''; {KNOWN}"),
    (push("world"), "body 'world' is the world, so a wrench cannot move it"),
    (push("post"), "body 'post' is fixed to the world, so a wrench cannot move it"),
    (push(force=(math.nan, 0, 0)), "wrench.wrench.force is (nan, 0, 0); every component must be finite"),
    (push(torque=(0, math.inf, 0)), "wrench.wrench.torque is (0, inf, 0); every component must be finite"),
    (push(point=(0, 0, -math.inf)), "application_point is (0, 0, -inf); every component must be finite"),
    (
        push(force=(1e300, 0, 0), point=(0, 1e300, 0)),
        "force and application_point are too large: their torque is not finite",
    ),
    (push(duration=-1), "duration is -1 s; it must not be negative"),
    (push(duration=1, ramp=-0.5), "ramp_down_duration is -0.5 s; it must not be negative"),
    (push(duration=1, ramp=1.5), "ramp_down_duration (1.5 s) must not exceed duration (1 s)"),
]


@pytest.mark.parametrize(("bad", "reason"), REFUSED, ids=[reason[:40] for _, reason in REFUSED])
def test_one_wrong_wrench_refuses_the_whole_request(world, bad, reason):
    call = ask(world, push(force=(5, 0, 0), duration=1.0), bad)
    assert call.refusal == f"external_wrenches[1]: {reason}; nothing was applied"
    world.loop.step(10)
    assert not world.data.qvel.any()


def test_an_unknown_value_of_wait_is_refused(world):
    assert ask(world, push(force=(1, 0, 0)), wait="no").refusal == "parameter wait is 'no'; allowed: true, false"
    world.loop.step(1)
    assert not world.data.qvel.any()


def test_a_reset_ends_every_wrench_and_reports_it(world):
    call = ask(world, push(force=(5, 0, 0), duration=10.0))
    world.loop.step(10)
    world.loop.reset(Reset())
    assert call.refusal == "cancelled: the world was reset"
    world.loop.step(10)
    assert not world.data.qvel.any()


def arrow(marker):
    return marker.ns, marker.header.frame_id, marker.action, [(p.x, p.y, p.z) for p in marker.points]


def test_arrows_show_force_and_torque_in_the_body_frame_and_go_when_the_wrench_ends(world):
    ask(world, push(force=(100, 0, 0), torque=(0, 10, 0), point=(0.1, 0.2, 0), duration=0.1))
    world.loop.step(60)
    first, *_, last = world.published(MARKERS)
    force, torque = first.markers
    assert arrow(force) == ("external_wrench/force", "box", Marker.ADD, [(0.1, 0.2, 0.0), (1.1, 0.2, 0.0)])
    assert arrow(torque) == ("external_wrench/torque", "box", Marker.ADD, [(0.1, 0.2, 0.0), (0.1, 1.2, 0.0)])
    red, cyan = ((m.color.r, m.color.g, m.color.b, m.color.a) for m in (force, torque))
    assert red == pytest.approx((1.0, 0.0, 0.0, 0.8), abs=1e-7)
    assert cyan == pytest.approx((0.0, 0.7, 0.9, 0.8), abs=1e-7)
    assert (force.scale.x, force.scale.y, force.scale.z) == (0.02, 0.04, 0.0)
    assert force.type == Marker.ARROW
    assert force.header.stamp.to_ns() == 0
    assert [(m.ns, m.id, m.action) for m in last.markers] == [
        ("external_wrench/force", force.id, Marker.DELETE),
        ("external_wrench/torque", torque.id, Marker.DELETE),
    ]


def test_arrows_shrink_with_the_ramp_and_a_zero_vector_has_none(world):
    ask(world, push(force=(0, 0, 50), duration=1.0, ramp=1.0))
    world.loop.step(500)
    shown = [m for array in world.published(MARKERS) for m in array.markers if m.action == Marker.ADD]
    assert {m.ns for m in shown} == {"external_wrench/force"}
    lengths = [m.points[1].z - m.points[0].z for m in shown]
    assert lengths[0] == pytest.approx(0.5)
    assert all(a > b for a, b in itertools.pairwise(lengths))
    assert lengths[-1] < 0.03


def test_each_wrench_keeps_its_marker_id_while_others_come_and_go(world):
    ask(world, push(force=(1, 0, 0), duration=0.05))
    ask(world, push("ball", force=(1, 0, 0), duration=0.5))
    world.loop.step(200)
    ids = {m.header.frame_id: set() for m in world.published(MARKERS)[0].markers}
    for array in world.published(MARKERS):
        for marker in array.markers:
            ids.setdefault(marker.header.frame_id, set()).add(marker.id)
    assert ids["box"].isdisjoint(ids["ball"])
    assert [len(v) for v in ids.values()] == [1, 1]


def test_arrow_lengths_follow_the_parameters(box_model):
    world = World(box_model)
    world.add(ExternalWrench, "external_wrench", force_arrow_scale=0.5, torque_arrow_scale=2)
    ask(world, push(force=(1, 0, 0), torque=(0, 0, 1), duration=0.1))
    world.loop.step(1)
    force, torque = world.published(MARKERS)[0].markers
    assert force.points[1].x == pytest.approx(0.5)
    assert torque.points[1].z == pytest.approx(2.0)


def test_a_time_step_that_is_no_simple_fraction_does_not_break_the_end_of_a_long_wrench():
    model = mujoco.MjModel.from_xml_string(BOX.replace("0.002", "0.016666666667"))
    world = World(model)
    world.add(ExternalWrench, "external_wrench")
    call = ask(world, push(force=(1e-3, 0, 0), duration=166.666666667))
    world.loop.step(10_001)
    assert call.response.success


def test_only_so_many_wrenches_may_act_at_a_time(world):
    first = ask(world, *[push(force=(1, 0, 0), duration=1.0)] * 900)
    assert ask(world, *[push(force=(1, 0, 0), duration=1.0)] * 101).refusal == (
        "900 wrenches are active and 101 more were requested; at most 1000 can be active at the same time; "
        "nothing was applied"
    )
    world.loop.reset(Reset())
    assert first.refusal == "cancelled: the world was reset"
    assert not ask(world, *[push(force=(1, 0, 0), duration=1.0)] * 1000).answered
