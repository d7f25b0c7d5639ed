"""Frames of the view: when they are due, and what they contain."""

import gzip
import hashlib
import json
from time import perf_counter

import mujoco
import numpy as np
import pytest
from services.view_packs import EVERYTHING, Frame, Pack, State

from mjplug.services.view import feed, service
from mjplug.services.view.moving import moving_bodies
from mjplug.testing import World


class Query:
    """A query that keeps its answer."""

    def __init__(self):
        self.answers = []

    def reply(self, payload, encoding, attachment=""):
        self.answers.append((payload, encoding, attachment))

    def refuse(self, reason):
        self.answers.append(reason)


class View:
    """A world with a view, whose wall time a test sets."""

    def __init__(self, model=EVERYTHING, **options):
        self.world = World(model, **options)
        self.loop = self.world.loop
        transport = self.world.transport
        service.offer(self.loop, transport, self.world.workers, "lab/mjplug", {"lamp": "heartbeat"})
        self.publisher = transport.bytes_publishers["lab/mjplug/@view/frame"]
        self._transport = transport
        self.now = perf_counter()

    @property
    def frames(self):
        return [Frame(payload) for payload in self.publisher.payloads]

    @property
    def worker(self):
        return self.world.workers.workers.get("view")

    def match(self):
        self.publisher.matched = True
        self.publisher.on_matched()
        self.world.step(0)
        # The server takes the time of the call from the clock.
        self.now = max(self.now, perf_counter())

    def pass_time(self, seconds):
        """Runs the timers that are due, as the loop does, in steps of a millisecond."""
        for _ in range(round(1000 * seconds)):
            self.now += 0.001
            if self.now >= self.loop.wall_timers.next_due:
                self.loop.wall_timers.run_due(self.now)
                self.world.step(0)

    def ask(self, what):
        query = Query()
        self._transport.queryables[f"lab/mjplug/@view/{what}"](query)
        # The second time, the answer of the worker.
        self.world.step(0)
        self.world.step(0)
        self.now = max(self.now, perf_counter())
        return query.answers


@pytest.fixture
def view():
    return View()


def test_without_a_subscriber_there_is_no_worker_no_timer_and_nothing_before_a_step(view):
    view.world.step(100)
    view.pass_time(2.0)
    assert view.worker is None
    assert view.loop.wall_timers.next_due == float("inf")
    assert view.loop.steppers.active == ()
    assert view.frames == []


def test_a_frame_has_the_poses_that_mujoco_computes_from_the_state(view):
    view.world.data.qvel[:] = np.linspace(-1.0, 1.0, view.world.model.nv)
    view.world.step(50)
    view.match()
    view.pass_time(0.01)
    (frame,) = view.frames
    model, data = view.world.model, mujoco.MjData(view.world.model)
    data.qpos, data.mocap_pos, data.mocap_quat = (
        view.world.data.qpos,
        view.world.data.mocap_pos,
        view.world.data.mocap_quat,
    )
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)
    mujoco.mj_flex(model, data)
    moving = moving_bodies(model)
    np.testing.assert_array_equal(frame.bodies[:, :3], data.xpos[moving].astype(np.float32))
    np.testing.assert_array_equal(frame.bodies[:, 3:], data.xquat[moving].astype(np.float32))
    np.testing.assert_array_equal(frame.cameras[:, :3], data.cam_xpos.astype(np.float32))
    np.testing.assert_array_equal(frame.cameras[:, 3:], data.cam_xmat.astype(np.float32))
    np.testing.assert_array_equal(frame.vertices, data.flexvert_xpos.astype(np.float32))
    assert not np.array_equal(data.xpos, view.world.data.xpos)
    assert (frame.time, frame.step, frame.epoch, frame.flags) == (0.1, 50, 0, 0)


@pytest.mark.parametrize("timestep", [0.002, 1 / 240, 0.0003])
def test_the_step_of_a_frame_is_exact(timestep):
    view = View(
        f"<mujoco><option timestep='{timestep!r}'/><worldbody><body><freejoint/>"
        "<geom size='.1'/></body></worldbody></mujoco>"
    )
    view.match()
    for _ in range(20):
        view.world.step(7)
        view.pass_time(0.02)
    assert [frame.step for frame in view.frames][-20:] == [7 * n for n in range(1, 21)]


def test_at_most_sixty_frames_are_sent_in_a_second_of_wall_time(view):
    view.match()
    for _ in range(1000):
        view.world.step(1)
        view.pass_time(0.001)
    assert 55 <= len(view.frames) <= 61


def test_while_paused_a_frame_is_sent_once_a_second_and_after_each_change():
    view = View(paused=True)
    view.match()
    view.pass_time(0.95)
    assert len(view.frames) == 1
    assert view.frames[0].flags == 1
    view.pass_time(2.0)
    assert len(view.frames) == 3
    view.world.step(1)
    view.pass_time(0.02)
    assert (len(view.frames), view.frames[-1].step) == (4, 1)
    view.world.data.qpos[0] = 0.5
    view.world.simulation.forward()
    view.pass_time(0.02)
    assert len(view.frames) == 5
    view.world.reset()
    view.pass_time(0.02)
    assert (len(view.frames), view.frames[-1].epoch) == (6, 1)


def test_the_worker_ends_a_while_after_the_last_subscriber_and_starts_again_for_the_next_one(view):
    view.match()
    view.pass_time(0.1)
    first = view.worker
    view.publisher.matched = False
    view.pass_time(feed.LINGER - 0.5)
    assert not first.stopped
    view.pass_time(1.0)
    assert first.stopped
    assert view.loop.wall_timers.next_due == float("inf")
    count = len(view.frames)
    view.match()
    view.pass_time(0.02)
    assert view.worker is not first
    assert len(view.frames) == count + 1


def test_a_query_for_the_scene_is_answered_with_the_pack_and_its_hash_and_the_pack_is_made_once(view):
    ((payload, encoding, sha256),) = view.ask("scene")
    assert encoding == "application/gzip"
    assert hashlib.sha256(payload).hexdigest() == sha256
    assert Pack(gzip.decompress(payload)).header["name"] == "everything"
    performed = view.worker.status.performed
    assert view.ask("scene") == [(payload, encoding, sha256)]
    assert view.worker.status.performed == performed == 1
    view.pass_time(feed.LINGER + 1.0)
    assert view.worker.stopped
    assert view.ask("scene") == [(payload, encoding, sha256)]


def test_the_description_names_the_scene_the_model_and_the_state_of_the_simulation(view):
    view.world.step(3)
    ((payload, encoding, _),) = view.ask("info")
    info = json.loads(payload)
    assert encoding == "application/json"
    assert (info["name"], info["step"], info["epoch"], info["paused"]) == ("/lab/mjplug", 3, 0, False)
    assert (info["speed"], info["timestep"], info["plugins"]) == ("max", 0.002, {"lamp": "heartbeat"})
    assert info["scene"] == view.ask("scene")[0][2]
    assert info["bodies"][:4] == ["world", "post", "arm", "hand"]
    view.loop.pause()
    view.world.reset()
    info = json.loads(view.ask("info")[0][0])
    assert (info["epoch"], info["paused"]) == (1, True)


def test_a_scene_that_takes_longer_than_the_worker_lingers_is_made_nevertheless():
    view = View()
    publisher = view.world.transport.bytes_publishers["lab/mjplug/@view/overlay/frames"]
    publisher.matched = True
    publisher.on_matched()
    view.world.step(0)
    view.now = max(view.now, perf_counter())
    view.pass_time(0.1)
    publisher.matched = False
    view.worker.hold()
    assert view.ask("scene") == []
    view.pass_time(5 * feed.LINGER)
    assert not view.worker.stopped
    query = Query()
    view.world.transport.queryables["lab/mjplug/@view/model"](query)
    view.worker.release()
    view.world.step(0)
    view.world.step(0)
    view.now = max(view.now, perf_counter())
    assert len(view.ask("scene")) == len(query.answers) == 1
    view.pass_time(feed.LINGER + 1.0)
    assert view.worker.stopped
    assert view.loop.wall_timers.next_due == float("inf")


def test_a_scene_that_cannot_be_made_is_refused_and_the_worker_ends(view):
    view.match()
    view.pass_time(0.1)
    view.worker.hold()
    view.publisher.matched = False
    query = Query()
    view.world.transport.queryables["lab/mjplug/@view/scene"](query)
    view.world.step(0)
    view.worker.spec.on_lost(frozenset({"scene", "model"}), "out of memory")
    assert query.answers == ["the drawing pack cannot be made: out of memory"]
    view.now = max(view.now, perf_counter())
    view.pass_time(2 * feed.LINGER)
    assert view.worker.stopped


def test_the_saved_model_is_the_compiled_model_and_names_the_version(view):
    ((payload, encoding, version),) = view.ask("model")
    assert (encoding, version) == ("application/gzip", mujoco.__version__)
    saved = mujoco.MjModel.from_binary_path("model.mjb", {"model.mjb": gzip.decompress(payload)})
    ours = view.world.model
    assert (saved.nq, saved.nbody, saved.names) == (ours.nq, ours.nbody, ours.names)
    np.testing.assert_array_equal(saved.geom_size, ours.geom_size)
    assert view.ask("model") == [(payload, encoding, version)]
    assert view.worker.status.performed == 1


def test_a_state_is_that_of_the_simulation_and_is_sent_only_while_it_has_a_subscriber(view):
    states = view.world.transport.bytes_publishers["lab/mjplug/@view/state"]
    view.world.data.qvel[:] = np.linspace(-1.0, 1.0, view.world.model.nv)
    view.world.data.ctrl[:] = 0.25
    view.world.step(50)
    view.match()
    view.pass_time(0.1)
    assert states.payloads == []
    states.matched = True
    states.on_matched()
    view.world.step(1)
    view.now = max(view.now, perf_counter())
    view.loop.pause()
    view.pass_time(0.02)
    state = State(states.payloads[-1])
    kind = mujoco.mjtState.mjSTATE_INTEGRATION
    expected = np.empty(mujoco.mj_stateSize(view.world.model, kind))
    mujoco.mj_getState(view.world.model, view.world.data, expected, kind)
    np.testing.assert_array_equal(state.values, expected)
    assert (state.step, state.epoch, state.flags) == (51, 0, 1)
    assert state.time == pytest.approx(0.102)


def test_the_perturbation_shows_what_a_viewer_drags(view):
    shown = view.world.transport.bytes_publishers["lab/mjplug/@view/overlay/perturbation"]
    view.loop.pause()
    shown.matched = True
    shown.on_matched()
    view.world.step(0)
    view.now = max(view.now, perf_counter())
    view.pass_time(0.02)
    drag = view.world.transport.bytes_subscriptions["lab/mjplug/@view/drag"]
    drag(json.dumps({"viewer": "ann", "body": "hand", "target": [0.5, 0.0, 2.0]}).encode())
    view.world.step(0)
    view.pass_time(0.05)
    counts = [int.from_bytes(payload[12:16], "little") for payload in shown.payloads]
    assert (counts[0], counts[-1]) == (0, 3)
    drag(json.dumps({"viewer": "ann", "release": True}).encode())
    view.world.step(0)
    view.pass_time(0.05)
    assert int.from_bytes(shown.payloads[-1][12:16], "little") == 0


def test_an_overlay_is_made_only_while_it_has_a_subscriber(view):
    contacts = view.world.transport.bytes_publishers["lab/mjplug/@view/overlay/contacts"]
    joints = view.world.transport.bytes_publishers["lab/mjplug/@view/overlay/joints"]
    view.match()
    view.pass_time(0.05)
    assert (contacts.payloads, joints.payloads) == ([], [])
    joints.matched = True
    joints.on_matched()
    view.world.step(1)
    view.now = max(view.now, perf_counter())
    view.pass_time(0.02)
    assert contacts.payloads == []
    assert len(joints.payloads) == 1
    joints.matched = view.publisher.matched = False
    view.world.step(1)
    view.pass_time(0.1)
    assert len(joints.payloads) == 1


def test_the_description_is_published_when_it_changes_while_it_has_a_subscriber(view):
    publisher = view.world.transport.bytes_publishers["lab/mjplug/@view/info"]

    def pass_a_second():
        for callback in view.loop.on_second:
            callback(perf_counter())

    view.ask("info")
    pass_a_second()
    assert publisher.payloads == []
    publisher.matched = True
    pass_a_second()
    pass_a_second()
    assert len(publisher.payloads) == 1
    view.loop.set_speed(2.0)
    view.loop.pause()
    pass_a_second()
    assert len(publisher.payloads) == 2
    info = json.loads(publisher.payloads[-1])
    assert (info["speed"], info["paused"], info["keyframes"]) == (2.0, True, ["up"])
    view.world.step(10)
    pass_a_second()
    assert len(publisher.payloads) == 2


def test_a_worker_that_cannot_run_gets_no_states_and_is_replaced_later(view):
    view.match()
    view.pass_time(0.1)
    first, count = view.worker, len(view.frames)
    first.status.state = "unavailable"
    view.world.step(1)
    view.pass_time(1.0)
    assert len(view.frames) == count
    view.pass_time(feed.LINGER + 1.0)
    assert first.stopped
    view.match()
    view.pass_time(0.1)
    assert len(view.frames) > count
