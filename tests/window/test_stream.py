"""The model and the states of a server, and what a window does without a screen or with another MuJoCo."""

import gzip
import struct
from contextlib import contextmanager
from time import monotonic

import mujoco
import numpy as np
import pytest
import zenoh
from waits import TIMEOUT

from mjplug import open_server
from mjplug.window import WindowError, run_window
from mjplug.window.drag import drag_message
from mjplug.window.feed import Feed
from mjplug.window.screen import check_screen
from mjplug.window.stream import SIGNATURE, States, fetch_model, read_state

BOX = """
<mujoco><worldbody><geom type="plane" size="3 3 .1"/>
  <body name="box" pos="0 0 .5"><freejoint/><geom type="box" size=".1 .2 .3" pos=".05 0 0" euler="10 20 30"/></body>
</worldbody></mujoco>
"""


def payload(values, paused=False, count=None):
    header = struct.pack("<ddIIHHI", 1.5, 0.0, 2, 750, int(paused), 0, len(values) if count is None else count)
    return header + np.asarray(values, "<f8").tobytes()


def test_a_state_is_read_as_documented():
    state = read_state(payload([1.0, 2.0, 3.0], paused=True))
    assert (state.time, state.epoch, state.step, state.paused) == (1.5, 2, 750, True)
    np.testing.assert_array_equal(state.values, [1.0, 2.0, 3.0])


@pytest.mark.parametrize("content", [b"", b"abc", payload([1.0], count=2), payload([1.0, 2.0], count=1)])
def test_an_incomplete_state_is_refused(content):
    with pytest.raises(WindowError, match="a state of the server has"):
        read_state(content)


@pytest.mark.parametrize("environment", [{}, {"DISPLAY": ""}])
def test_without_a_screen_the_error_says_what_to_do(environment):
    with pytest.raises(WindowError, match="neither DISPLAY nor WAYLAND_DISPLAY is set; `mjplug view` without --window"):
        check_screen(environment, "linux")
    check_screen({"WAYLAND_DISPLAY": "wayland-0"}, "linux")
    check_screen(environment, "win32")


def test_the_window_is_refused_before_the_server_is_asked(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    with pytest.raises(WindowError, match="there is no screen"):
        run_window(None)


@contextmanager
def model_of(version):
    """A session with a stand-in for a server's model of some version of MuJoCo; None stands for an error reply."""
    with zenoh.open(zenoh_alone()) as session:

        def reply(query):
            with query:
                if version is None:
                    query.reply_err(b"no memory")
                else:
                    query.reply("lab/sim/@view/model", gzip.compress(b"x"), attachment=version.encode())

        queryable = session.declare_queryable("lab/sim/@view/model", reply)
        yield session, "lab/sim"
        queryable.undeclare()


def zenoh_alone():
    config = zenoh.Config()
    config.insert_json5("listen/endpoints", "[]")
    config.insert_json5("scouting/multicast/enabled", "false")
    return config


def test_another_version_of_mujoco_is_refused_with_both_versions():
    with model_of("2.9.9") as (client, key):
        expected = f"/{key} runs MuJoCo 2.9.9, but this Python has MuJoCo {mujoco.__version__}"
        with pytest.raises(WindowError, match=expected):
            fetch_model(client, key)


def test_a_server_that_cannot_make_its_model_is_reported():
    with model_of(None) as (client, key), pytest.raises(WindowError, match="provide its model: no memory"):
        fetch_model(client, key)


def test_a_window_gets_the_model_and_the_states_of_a_server(tmp_path):
    scene = tmp_path / "box.xml"
    scene.write_text(BOX)
    with open_server(scene, paused=True) as server, server.client() as client:
        model = fetch_model(client.session, "mjplug")
        assert model.body("box").id == 1
        states = States(client.session, "mjplug")
        feed, data = Feed("/mjplug", model, states), mujoco.MjData(model)
        until = monotonic() + TIMEOUT
        while (state := feed.load(data, 1.0)) is None:
            assert monotonic() < until
        assert (state.step, state.paused) == (0, True)
        client.call("~/step_simulation", steps=100)
        while (state := feed.load(data, 1.0)).step < 100:
            assert monotonic() < until
        expected = mujoco.MjData(model)
        mujoco.mj_step(model, expected, 100)
        np.testing.assert_array_equal(data.qpos, expected.qpos)
        np.testing.assert_array_equal(data.qvel, expected.qvel)
        # A viewer may change its data; the next load restores the state.
        data.qpos[:] = 0.0
        feed.load(data, 0.0)
        np.testing.assert_array_equal(data.qpos, expected.qpos)
        assert not feed.silent
        states.close()


def test_a_state_of_another_model_ends_the_window():
    model = mujoco.MjModel.from_xml_string(BOX)

    class Other:
        def next(self, timeout):
            return read_state(payload([0.0] * (mujoco.mj_stateSize(model, SIGNATURE) + 1)))

    with pytest.raises(WindowError, match="/mjplug has another model now; run the command again"):
        Feed("/mjplug", model, Other()).load(mujoco.MjData(model), 0.0)


@pytest.mark.parametrize("active", [mujoco.mjtPertBit.mjPERT_TRANSLATE, mujoco.mjtPertBit.mjPERT_ROTATE])
def test_a_drag_is_what_mujoco_itself_would_apply(active):
    model = mujoco.MjModel.from_xml_string(BOX)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    scene, camera, perturbation = mujoco.MjvScene(model, 10), mujoco.MjvCamera(), mujoco.MjvPerturb()
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, camera, mujoco.mjtCatBit.mjCAT_ALL, scene)
    perturbation.select, perturbation.localpos = 1, (0.1, 0.0, 0.3)
    mujoco.mjv_initPerturb(model, data, scene, perturbation)
    assert drag_message(model, perturbation) is None
    perturbation.active = int(active)
    before = drag_message(model, perturbation)
    if active == mujoco.mjtPertBit.mjPERT_TRANSLATE:
        # Not moved yet, so the target is the point itself.
        np.testing.assert_allclose(before["target"], data.xpos[1] + (0.1, 0.0, 0.3), atol=1e-12)
        assert "rotate" not in before
        perturbation.refselpos = (1.0, 2.0, 3.0)
        after = drag_message(model, perturbation)
        assert (after["body"], after["local"], after["target"]) == (1, [0.1, 0.0, 0.3], [1.0, 2.0, 3.0])
    else:
        np.testing.assert_allclose(before["rotate"], data.xquat[1], atol=1e-12)
        assert "target" not in before
    perturbation.select = 0
    assert drag_message(model, perturbation) is None
