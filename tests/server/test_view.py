"""The simulation view of a running server, as a Zenoh client without mjplug sees it."""

import gzip
import hashlib
import json
import queue
import time

import mujoco
import numpy as np
import pytest
import zenoh
from services.view_packs import EVERYTHING, Frame, Pack, State
from waits import TIMEOUT
from wire.conftest import Client

from mjplug import open_server
from mjplug.services.view import drags
from mjplug.wire.bytes_endpoints import MAX_OPEN_QUERIES


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "everything.xml"
    path.write_text(EVERYTHING)
    return path


@pytest.fixture
def server(scene):
    with open_server(scene, paused=True) as opened:
        yield opened


@pytest.fixture
def client(server):
    opened = Client(server.endpoint)
    yield opened
    opened.close()


def reply(client, key):
    """The one reply to a query."""
    (answer,) = client.session.get(key, timeout=TIMEOUT)
    return answer.ok


def test_a_client_gets_the_description_the_scene_and_the_frames(server, client):
    info = json.loads(bytes(reply(client, "mjplug/@view/info").payload))
    assert info["paused"] is True
    scene = reply(client, "mjplug/@view/scene")
    packed = bytes(scene.payload)
    assert scene.attachment.to_string() == hashlib.sha256(packed).hexdigest() == info["scene"]
    header = Pack(gzip.decompress(packed)).header
    frames = client.listen("mjplug/@view/frame")
    frame = Frame(bytes(frames.get(timeout=TIMEOUT).payload))
    assert (frame.step, frame.flags) == (0, 1)
    model = mujoco.MjModel.from_xml_string(EVERYTHING)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    np.testing.assert_array_equal(frame.bodies[:, :3], data.xpos[header["moving"]].astype(np.float32))
    with server.client() as connection:
        connection.call("~/step_simulation", steps=3)
    while frame.step < 3:
        frame = Frame(bytes(frames.get(timeout=TIMEOUT).payload))
    assert frame.time == 0.006


def test_a_client_with_mujoco_gets_the_model_and_the_states(server, client):
    answer = reply(client, "mjplug/@view/model")
    assert answer.attachment.to_string() == mujoco.__version__
    model = mujoco.MjModel.from_binary_path("model.mjb", {"model.mjb": gzip.decompress(bytes(answer.payload))})
    states = client.listen("mjplug/@view/state")
    state = State(bytes(states.get(timeout=TIMEOUT).payload))
    assert (state.step, state.flags) == (0, 1)
    kind = mujoco.mjtState.mjSTATE_INTEGRATION
    assert len(state.values) == mujoco.mj_stateSize(model, kind)
    with server.client() as connection:
        connection.call("~/step_simulation", steps=3)
    while state.step < 3:
        state = State(bytes(states.get(timeout=TIMEOUT).payload))
    data = mujoco.MjData(model)
    mujoco.mj_setState(model, data, state.values, kind)
    assert data.time == state.time == 0.006


def test_a_wildcard_reads_neither_scene_nor_frames(server, client):
    seen = queue.SimpleQueue()
    subscriber = client.session.declare_subscriber("**", seen.put)
    frames = client.listen("mjplug/@view/frame")
    frames.get(timeout=TIMEOUT)
    subscriber.undeclare()
    while not seen.empty():
        assert "@view" not in str(seen.get().key_expr)
    answers = [*client.session.get("mjplug/@view/*", target=zenoh.QueryTarget.ALL, timeout=TIMEOUT)]
    assert {answer.err.payload.to_string() for answer in answers if answer.ok is None} == {
        "query exactly mjplug/@view/info",
        "query exactly mjplug/@view/model",
        "query exactly mjplug/@view/scene",
    }


def test_queries_above_the_maximum_are_refused_and_the_others_are_answered(server, client):
    replies = [client.session.get("mjplug/@view/scene", timeout=TIMEOUT) for _ in range(MAX_OPEN_QUERIES + 20)]
    answers = [answer for channel in replies for answer in channel]
    assert len(answers) == MAX_OPEN_QUERIES + 20
    packs = {bytes(answer.ok.payload) for answer in answers if answer.ok}
    assert len(packs) == 1
    refusals = {answer.err.payload.to_string() for answer in answers if not answer.ok}
    assert refusals <= {"busy: 64 queries are waiting, which is the maximum; try again later"}


@pytest.fixture
def stepped(scene):
    """A server that the test steps."""
    with open_server(scene, run=False) as opened:
        yield opened


def step_until(server, condition):
    """Takes steps, and returns when the condition is true."""
    until = time.monotonic() + TIMEOUT
    while not condition():
        assert time.monotonic() < until
        server.step(1)


@pytest.fixture
def viewer(stepped):
    """A client whose messages about drags reach the server."""
    client = Client(stepped.endpoint)
    client.publisher("mjplug/@view/drag")
    yield client
    client.close()


def drag(viewer, **message):
    viewer.session.put("mjplug/@view/drag", json.dumps({"viewer": "ann", "body": "hand", **message}))


def pull(viewer, server):
    """Pulls the body upwards until its force acts; returns the forces on all bodies."""
    force = server.data.xfrc_applied
    drag(viewer, target=[0.0, 0.0, 5.0])
    step_until(server, force.any)
    return force


def test_a_viewer_pulls_a_body_and_lets_it_go(stepped, viewer, monkeypatch):
    monkeypatch.setattr(drags, "HOLD_TIME", 1000.0)
    force = pull(viewer, stepped)
    body = stepped.model.body("hand").id
    assert force[body, 2] > 0.0
    assert not np.delete(force, body, axis=0).any()
    drag(viewer, release=True)
    step_until(stepped, lambda: not force.any())


def test_a_viewer_that_falls_silent_lets_go(stepped, viewer, monkeypatch):
    # Long enough to see the force on a busy machine.
    monkeypatch.setattr(drags, "HOLD_TIME", 3.0)
    force = pull(viewer, stepped)
    step_until(stepped, lambda: not force.any())


def test_a_viewer_whose_connection_ends_lets_go_at_once(stepped, viewer, monkeypatch):
    monkeypatch.setattr(drags, "HOLD_TIME", 1000.0)
    token = viewer.session.liveliness().declare_token("mjplug/@view/viewer/ann")
    force = pull(viewer, stepped)
    viewer.close()
    step_until(stepped, lambda: not force.any())
    del token


def test_too_large_a_message_is_refused(stepped, viewer, caplog):
    drag(viewer, target=[0.0, 0.0, 5.0], padding="x" * 5000)
    step_until(stepped, lambda: "at most 4096 are accepted" in caplog.text)
    assert not stepped.data.xfrc_applied.any()
