"""`mjplug.open_server`: a server that the caller steps."""

import threading

import mujoco
import numpy as np
import pytest
from conftest import ARM
from echo_plugin import Echo, fail
from waits import TIMEOUT

from mjplug import open_server
from mjplug.client import connect
from mjplug.errors import MjplugError, PluginError, RequestError


def directly(model_text, steps, keyframe):
    """The same steps with MuJoCo alone."""
    model = mujoco.MjModel.from_xml_string(model_text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(keyframe).id)
    data.time = 0.0
    for _ in range(steps):
        mujoco.mj_step(model, data)
    return data


def assert_same_bits(data, expected):
    for name in ("qpos", "qvel", "act", "qacc_warmstart", "sensordata", "ctrl"):
        assert getattr(data, name).tobytes() == getattr(expected, name).tobytes(), name
    assert data.time == expected.time


def test_steps_of_the_caller_are_mujocos_to_the_last_bit(arm):
    with open_server(arm, keyframe="bent", run=False, plugins=["heartbeat", "joint_state_publisher"]) as server:
        assert_same_bits(server.data, directly(ARM, 0, "bent"))
        for steps, total in ((1, 1), (1, 2), (7, 9), (0, 9), (991, 1000)):
            server.step(steps)
            assert_same_bits(server.data, directly(ARM, total, "bent"))
        assert server.time_ns == 2_000_000_000
        server.client().call("~/reset_world")
        server.step(5)
        expected = directly(ARM, 5, "bent")
        for name in ("qpos", "qvel", "act", "qacc_warmstart"):
            assert getattr(server.data, name).tobytes() == getattr(expected, name).tobytes(), name


def test_steps_of_the_caller_and_of_a_request_do_the_same(arm):
    with open_server(arm, keyframe="bent", run=False) as one, open_server(arm, keyframe="bent", run=False) as other:
        clients = [server.client() for server in (one, other)]
        clocks = [client.subscribe("/clock") for client in clients]
        for steps in (1, 1, 48):
            one.step(steps)
            assert clients[1].call("~/step_simulation", steps=steps).message.startswith(f"took {steps} steps")
            assert_same_bits(one.data, other.data)
            # The time of the last step is published by either.
            assert one.time_ns == other.time_ns
            for clock in clocks:
                while clock.next(TIMEOUT).clock.to_ns() != one.time_ns:
                    pass


def test_only_the_thread_that_opened_a_stepped_server_steps_it(arm):
    errors = []

    def attempt():
        try:
            server.step()
        except MjplugError as error:
            errors.append(str(error))

    with open_server(arm, run=False) as server:
        thread = threading.Thread(target=attempt)
        thread.start()
        thread.join()
        assert errors == ["step: /mjplug belongs to the thread that opened it"]
        for steps in (-1, 2**32, 1.5):
            with pytest.raises(MjplugError, match=f"steps is {steps}; it must be an integer from 0 to 4294967295"):
                server.step(steps)
        server.step(np.int64(0))
        assert server.time_ns == 0
    with pytest.raises(MjplugError, match="the server /mjplug has been stopped"):
        server.step()
    with open_server(arm, paused=True) as server:
        for name in ("model", "data"):
            with pytest.raises(MjplugError, match=f"{name} needs run=False: the physics thread of /mjplug owns"):
                getattr(server, name)
        with pytest.raises(MjplugError, match="step needs run=False"):
            server.step()


def test_steps_are_refused_as_those_of_a_request_are(arm):
    with open_server(arm, run=False) as server:
        server.client().call("~/set_pause", paused=False)
        with pytest.raises(
            RequestError, match=r"the simulation is running; pause it first \(~/set_pause, or mjplug sim pause\)"
        ):
            server.step()
        server.client().call("~/set_pause", paused=True)
        server.step()
        server.data.qvel[0] = np.nan
        with pytest.raises(RequestError, match=r"diverged in step .* \(0 of 10 steps were taken\)"):
            server.step(10)
        assert server.running


def test_a_stepped_server_serves_others_while_it_waits(arm):
    with open_server(arm, run=False) as server:
        answers = []

        def ask():
            with connect(server.endpoint) as client:
                answers.append(client.call("~/step_simulation", steps=20).message)
                server.stop()

        thread = threading.Thread(target=ask)
        thread.start()
        assert server.wait(timeout=60.0)
        thread.join()
        assert answers == [f"took 20 steps; t = {server.time_ns / 1e9:.6f} s"]
        with pytest.raises(MjplugError, match="the server /mjplug was stopped"):
            server.step()
    with open_server(arm, run=False) as server:
        assert server.wait(timeout=0.01) is False


def test_a_failure_of_a_stepped_server_is_raised_by_the_step():
    with open_server("bundled:box", plugins={"echo": Echo}, run=False) as server:
        fail(server)
        with pytest.raises(PluginError, match="plugin echo failed"):
            # It serves while it waits for the response, and fails meanwhile.
            server.client().call("~/set_pause", paused=True)
        with pytest.raises(PluginError, match="plugin echo failed"):
            server.step()
