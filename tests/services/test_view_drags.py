"""Bodies that viewers hold: who holds what, and until when."""

import json
import logging
from time import perf_counter

import numpy as np
import pytest
from conftest import BOX

from mjplug.plugin import Parameters, Plugin
from mjplug.services.view import drags, service
from mjplug.testing import World


class Lab:
    """A world with a view and the viewers that drag."""

    def __init__(self, model=BOX, **options):
        self.world = World(model, **options)
        self.loop, self.data = self.world.loop, self.world.data
        transport = self.world.transport
        service.offer(self.loop, transport, self.world.workers, "mjplug", {})
        self._receive = transport.bytes_subscriptions["mjplug/@view/drag"]
        self.left = transport.watched["mjplug/@view/viewer/*"]

    def send(self, **message):
        self._receive(json.dumps(message).encode())
        self.world.step(0)

    def send_bytes(self, payload):
        self._receive(payload)
        self.world.step(0)

    def drag(self, viewer="ann", body="box", target=(1.0, 0.0, 1.0), **more):
        self.send(viewer=viewer, body=body, target=target, **more)

    def force(self, body="box"):
        """The force on a body in the next step, which is taken."""
        self.world.step(1)
        return self.data.xfrc_applied[self.world.simulation.body_id(body)].copy()

    def pass_time(self, seconds):
        self.loop.wall_timers.run_due(perf_counter() + seconds)


@pytest.fixture
def lab():
    return Lab()


def test_a_held_body_is_pulled_at_every_step_until_its_viewer_lets_go(lab):
    lab.drag()
    assert lab.force()[0] > 0.0
    assert lab.force()[0] > 0.0
    lab.send(viewer="ann", release=True)
    assert not lab.force().any()
    assert lab.loop.steppers.active == ()


def test_a_body_may_be_named_by_its_id(lab):
    lab.drag(body=2)
    assert lab.force("ball").any()
    assert not lab.force("box").any()


def test_two_viewers_hold_two_bodies_and_one_body_together(lab):
    lab.drag("ann", "box", (1.0, 0.0, 1.0))
    lab.drag("bob", "ball", (2.0, 5.0, 1.0))
    assert lab.force("box")[0] > 0.0
    assert lab.force("ball")[1] > 0.0
    lab.drag("bob", "box", (0.0, 5.0, 1.0))
    box = lab.force("box")
    assert box[0] > 0.0
    assert box[1] > 0.0
    assert not lab.force("ball").any()
    lab.send(viewer="ann", release=True)
    assert lab.force("box")[1] > 0.0


def test_a_viewer_that_is_silent_for_the_hold_time_in_wall_time_lets_go(lab, monkeypatch):
    assert drags.HOLD_TIME == 0.5
    # Longer than this test takes on a busy machine.
    monkeypatch.setattr(drags, "HOLD_TIME", 1000.0)
    lab.drag()
    lab.pass_time(900.0)
    assert lab.force().any()
    lab.pass_time(1000.0)
    assert not lab.force().any()
    assert lab.loop.wall_timers.next_due == float("inf")


def test_each_viewer_has_its_own_half_second(lab):
    lab.drag("ann", "box")
    lab.drag("bob", "ball", (2.0, 5.0, 1.0))
    start = perf_counter()
    while perf_counter() - start < 0.1:
        pass
    lab.drag("ann", "box")
    lab.loop.wall_timers.run_due(start + drags.HOLD_TIME)
    assert lab.force("box").any()
    assert not lab.force("ball").any()


def test_a_viewer_that_disconnects_lets_go(lab):
    lab.drag("ann")
    lab.drag("bob", "ball", (2.0, 5.0, 1.0))
    lab.left("mjplug/@view/viewer/ann")
    assert not lab.force("box").any()
    assert lab.force("ball").any()


def test_a_reset_ends_all_drags_until_the_viewer_lets_go_and_holds_again(lab):
    lab.drag()
    assert lab.force().any()
    lab.world.reset()
    assert not lab.force().any()
    lab.drag()
    assert not lab.force().any()
    lab.send(viewer="ann", release=True)
    lab.drag()
    assert lab.force().any()


def test_an_older_message_does_not_change_the_target(lab):
    lab.drag(target=(1.0, 0.0, 1.0), seq=5)
    lab.drag(target=(-1.0, 0.0, 1.0), seq=4)
    lab.drag(target=(-1.0, 0.0, 1.0), seq=5)
    assert lab.force()[0] > 0.0
    lab.drag(target=(-1.0, 0.0, 1.0), seq=6)
    assert lab.force()[0] < 0.0


def test_while_paused_dragging_sets_the_pose_of_a_free_body_and_stepping_pulls_it():
    lab = Lab(paused=True)
    lab.drag(target=(1.0, 2.0, 3.0), local=(0.0, 0.0, 0.0))
    np.testing.assert_allclose(lab.data.qpos[:3], (1.0, 2.0, 3.0), atol=1e-12)
    np.testing.assert_allclose(lab.data.xpos[1], (1.0, 2.0, 3.0), atol=1e-12)
    lab.drag(target=(1.0, 2.0, 4.0), rotate=(0.0, 0.0, 0.0, 2.0))
    np.testing.assert_allclose(lab.data.qpos[:7], (1.0, 2.0, 4.0, 0.0, 0.0, 0.0, 1.0), atol=1e-12)


def test_the_force_of_a_plugin_is_added_to_that_of_the_drag(lab):
    class Pushes(Plugin[Parameters]):
        def init(self, host, parameters):
            self.host = host
            host.activate()

        def update(self):
            self.host.data.xfrc_applied[1, 2] += 7.0

    lab.drag()
    lab.world.step(1)
    alone = Lab()
    alone.world.add(Pushes)
    alone.drag()
    np.testing.assert_allclose(alone.force(), lab.data.xfrc_applied[1] + (0, 0, 7.0, 0, 0, 0), atol=1e-12)


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        ({"viewer": "ann", "body": "bux", "target": [0, 0, 0]}, "bux"),
        ({"viewer": "ann", "body": "post", "target": [0, 0, 0]}, "fixed to the world"),
        ({"viewer": "ann", "body": 99, "target": [0, 0, 0]}, "the model has 4 bodies"),
        ({"viewer": "ann", "body": -1, "target": [0, 0, 0]}, "the model has 4 bodies"),
        ({"viewer": "ann", "body": "box"}, "target and rotate are missing"),
        ({"viewer": "ann", "target": [0, 0, 0]}, "body is missing"),
        ({"viewer": "ann", "body": "box", "target": [0, 0, 1e11]}, "target"),
        ({"viewer": "ann", "body": "box", "target": [0, 0]}, "target"),
        ({"viewer": "ann", "body": "box", "rotate": [0, 0, 0, 0]}, "norm must not be zero"),
        ({"viewer": "a/b", "body": "box", "target": [0, 0, 0]}, "viewer"),
        ({"viewer": "ann", "body": "box", "target": [0, 0, 0], "forse": 1}, "forse"),
    ],
)
def test_an_invalid_message_is_refused_with_a_reason_and_changes_nothing(lab, caplog, message, reason):
    with caplog.at_level(logging.WARNING):
        lab.send(**message)
    assert "a message to @view/drag was refused" in caplog.text
    assert reason in caplog.text
    assert lab.loop.steppers.active == ()


@pytest.mark.parametrize("payload", [b"", b"\xff\xfe", b"[]", b"{", b'{"viewer": NaN}', b"[" * 4000])
def test_bytes_that_are_no_message_are_refused(lab, caplog, payload):
    with caplog.at_level(logging.WARNING):
        lab.send_bytes(payload)
    assert "was refused" in caplog.text


def test_a_flood_of_messages_posts_one_call_and_the_newest_message_counts(lab):
    message = json.dumps({"viewer": "ann", "body": "box", "target": [1.0, 0.0, 1.0]}).encode()
    for _ in range(1000):
        lab._receive(message)
    lab._receive(message.replace(b"[1.0", b"[-1.0"))
    assert lab.loop.inbox.waiting == 1
    assert lab.force()[0] < 0.0


def test_more_viewers_than_the_maximum_are_refused(lab, caplog):
    with caplog.at_level(logging.WARNING):
        for index in range(drags.MAX_VIEWERS + 1):
            lab.drag(f"viewer{index}", "ball", (2.0, 0.0, 1.5))
    assert "64 viewers hold bodies, which is the maximum" in caplog.text
    assert np.isfinite(lab.force("ball")).all()


def test_viewers_that_leave_add_no_work_to_the_physics_thread_unless_they_hold_a_body(lab):
    for number in range(1000):
        lab.left(f"mjplug/@view/viewer/other{number}")
    assert lab.loop.inbox.waiting == 0
    lab.drag()
    for _ in range(1000):
        lab.left("mjplug/@view/viewer/ann")
    assert lab.loop.inbox.waiting == 1
    assert not lab.force().any()


def test_a_viewer_that_leaves_at_once_holds_nothing(lab):
    lab._receive(json.dumps({"viewer": "ann", "body": "box", "target": [1, 0, 1]}).encode())
    lab.left("mjplug/@view/viewer/ann")
    assert not lab.force().any()
