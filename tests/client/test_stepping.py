"""`Client.step` and `RunningServer.local`: the same functions over Zenoh and inside the process, with equal results."""

import os
import signal
import subprocess
import sys
import threading

import mujoco
import numpy as np
import pytest

from mjplug.client import ClientError, RequestRefused, UnknownNameError, WrongTypeError
from mjplug.errors import MjplugError
from mjplug_schemas.mjplug_msgs import Step
from mjplug_schemas.std_msgs import Float64MultiArray

CART_POLE = "examples/09_lockstep/cart_pole.xml"
PLUGINS = {
    "motor": {
        "type": "joint_commands",
        "groups": {"cart": {"joints": ["rail"], "interface": "effort", "topic": "/force"}},
    },
    "joints": {"type": "joint_state_publisher", "rate": 10.0},
}


@pytest.fixture(scope="module")
def model():
    return mujoco.MjModel.from_xml_path(CART_POLE)


@pytest.fixture(params=["wire", "local", "stepped here"])
def driver(request, mjplug_server):
    """A paused server, stepped over Zenoh, by a program whose server runs in a thread, and by the stepping thread."""
    if request.param == "stepped here":
        return mjplug_server(CART_POLE, plugins=PLUGINS, run=False).local
    server = mjplug_server(CART_POLE, plugins=PLUGINS, paused=True)
    return server.client() if request.param == "wire" else server.local


def alone(model, controls, steps):
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    states = []
    for row in controls:
        data.ctrl[:] = row
        mujoco.mj_step(model, data, steps)
        states.append((data.qpos.copy(), data.qvel.copy()))
    return tuple(np.array(column) for column in zip(*states, strict=True))


def test_steps_give_the_bits_of_mujoco_alone(driver, model):
    controls = np.random.default_rng(3).normal(size=(30, 1))
    qpos, qvel = alone(model, controls, 4)
    first = driver.step(4, controls[0])
    assert (first["qpos"].shape, first.step, first.time_ns) == ((2,), 4, 8_000_000)
    rest = driver.rollout(controls[1:], 4)
    assert rest["qpos"].shape == (29, 2)
    assert np.array_equal(np.vstack([first["qpos"], rest["qpos"]]), qpos)
    assert np.array_equal(np.vstack([first["qvel"], rest["qvel"]]), qvel)
    assert rest.step == 120


def test_results_have_the_shapes_of_mujoco_and_may_be_changed(driver, model):
    result = driver.step(ctrl=[[1.0], [2.0]], observe=["xpos", "xquat", "ctrl", "qpos"])
    assert result["xpos"].shape == (2, model.nbody, 3)
    assert result["xquat"].shape == (2, model.nbody, 4)
    assert result["ctrl"].tolist() == [[1.0], [2.0]]
    assert list(result) == ["xpos", "xquat", "ctrl", "qpos"]
    assert driver.step(ctrl=[1.0, 2.0], observe=["ctrl"])["ctrl"].tolist() == [[1.0], [2.0]]
    assert driver.step(observe=[], ctrl=[[1.0], [2.0]]).step == 6
    result["qpos"][:] = 0.0
    assert driver.step(0, observe=["ctrl"])["ctrl"].tolist() == [2.0]


def test_a_command_and_a_state_go_with_one_request(driver):
    for force in (Float64MultiArray(data=[3.0]), {"data": [3.0]}, [{"data": [1.0]}, {"data": [3.0]}]):
        result = driver.step(5, inputs={"/force": force}, observe=["ctrl", "qpos"], outputs=["/joint_states"])
        state = result.message("/joint_states")
        assert result["ctrl"].tolist() == [3.0]
        assert list(state.position) == result["qpos"].tolist()
        assert 1_000_000_000 * state.header.stamp.sec + state.header.stamp.nanosec == result.time_ns
    with pytest.raises(ClientError, match=r"/clock is not in outputs; topics: /joint_states"):
        result.message("/clock")


def test_wrong_requests_are_refused_with_a_sentence(driver):
    with pytest.raises(RequestRefused, match=r"ctrl\[0\] is nan"):
        driver.step(ctrl=[np.nan])
    with pytest.raises(RequestRefused, match="unknown array in observe 'qpso', did you mean 'qpos'"):
        driver.step(observe=["qpso"])
    with pytest.raises(RequestRefused, match=r"ctrl has 2 values|steps is 0 with 2 actions"):
        driver.step(0, ctrl=[1.0, 2.0])
    with pytest.raises(WrongTypeError, match=r"n is -1; it must be an integer from 0"):
        driver.step(-1)
    with pytest.raises(WrongTypeError, match=r"ctrl has the shape \(1, 1, 1\)"):
        driver.step(ctrl=[[[1.0]]])
    with pytest.raises(WrongTypeError, match=r"ctrl has the shape \(0, 1\)"):
        driver.step(ctrl=np.empty((0, 1)))
    with pytest.raises(WrongTypeError, match=r"actions have the shape \(1,\)"):
        driver.rollout([1.0])
    with pytest.raises(UnknownNameError, match="'/forze'"):
        driver.step(inputs={"/forze": {"data": [1.0]}})
    with pytest.raises(WrongTypeError, match="unknown field 'dta'"):
        driver.step(inputs={"/force": {"dta": [1.0]}})
    assert driver.step(0).step == 0


def test_sequences_are_simulated_in_copies(driver, model):
    controls = np.random.default_rng(4).normal(size=(3, 8, 1))
    results = driver.simulate(controls, 2, observe=["qvel", "ctrl"])
    assert results["qvel"].shape == (3, 8, 2)
    assert np.array_equal(results["ctrl"], controls)
    for sequence, qvel in zip(controls, results["qvel"], strict=True):
        assert np.array_equal(qvel, alone(model, sequence, 2)[1])
    assert driver.step(0).step == 0
    with pytest.raises(WrongTypeError, match=r"actions have the shape \(8, 1\); it must be \(B, k, nu\)"):
        driver.simulate(controls[0])
    with pytest.raises(RequestRefused, match="unknown array in observe 'xpos'"):
        driver.simulate(controls, observe=["xpos"])


def test_states_are_saved_and_restored(driver):
    driver.step(20, [1.0])
    driver.save("here")
    first = driver.rollout(np.ones((9, 1)), 3, outputs=["/joint_states"])
    driver.restore("here")
    again = driver.rollout(np.ones((9, 1)), 3, outputs=["/joint_states"])
    assert all(np.array_equal(first[name], again[name]) for name in first)
    assert (again.step, again.samples, again.epoch) == (first.step, first.samples, first.epoch + 1)


def test_another_server_continues_from_the_state_of_this_one(mjplug_server, tmp_path):
    options = {"plugins": PLUGINS, "settings": {"snapshots.folder": str(tmp_path)}}
    one = mjplug_server(CART_POLE, run=False, **options).local
    other = mjplug_server(CART_POLE, paused=True, **options).client()
    one.step(33, [2.0])
    one.fork(other)
    controls = np.random.default_rng(8).normal(size=(10, 1))
    assert np.array_equal(one.rollout(controls)["qpos"], other.rollout(controls)["qpos"])


def test_a_running_simulation_is_not_stepped(mjplug_server):
    server = mjplug_server(CART_POLE)
    for driver in (server.local, server.client()):
        with pytest.raises(RequestRefused, match="the simulation is running; pause it first"):
            driver.step()


def test_one_client_at_a_time_steps_a_server(mjplug_server):
    server = mjplug_server(CART_POLE, paused=True)
    first, second = server.client(), server.client()
    first.step()
    for other in (second, server.local):
        with pytest.raises(RequestRefused, match="another client steps this server"):
            other.step()
    with pytest.raises(RequestRefused, match="another client steps this server"):
        second.call("~/step_simulation", steps=1)
    with pytest.raises(RequestRefused, match="another client steps this server"):
        second.call("~/step", Step.Request())
    first.release()
    eventually(second.step)
    second.close()
    eventually(server.local.step)
    server.local.release()
    assert eventually(first.step).step == 4


def eventually(act):
    """The result of a call that is refused until the server knows that the previous owner has left."""
    for _ in range(500):
        try:
            return act()
        except RequestRefused:
            threading.Event().wait(0.02)
    raise AssertionError("still refused")


def test_the_steps_of_a_client_that_is_killed_end(mjplug_server):
    server = mjplug_server(CART_POLE, paused=True)
    code = (
        "import sys, mjplug.client; client = mjplug.client.connect(sys.argv[1]); client.step(); "
        "print('ready', flush=True); client.step(10**9)"
    )
    child = subprocess.Popen([sys.executable, "-c", code, server.endpoint], stdout=subprocess.PIPE, text=True)
    try:
        assert child.stdout.readline() == "ready\n"
        os.kill(child.pid, signal.SIGKILL)
    finally:
        child.kill()
        child.communicate()
    assert eventually(server.client().step).step >= 2


def test_a_program_that_steps_its_server_may_mix_the_two_ways(mjplug_server):
    server = mjplug_server(CART_POLE, run=False)
    server.local.step(3)
    server.step(2)
    assert server.local.step(0).step == 5
    assert server.local.call("~/set_pause", paused=True).success
    with pytest.raises(UnknownNameError, match="unknown service '~/set_paus'"):
        server.local.call("~/set_paus")


def test_a_server_that_was_stopped_cannot_be_stepped(mjplug_server):
    server = mjplug_server(CART_POLE, paused=True)
    local = server.local
    server.stop()
    with pytest.raises(MjplugError, match="stopped"):
        local.step()
    with pytest.raises(MjplugError, match="stopped"):
        _ = server.local


def test_the_client_imports_numpy_only_to_step():
    code = (
        "import sys, mjplug.client; assert 'numpy' not in sys.modules; "
        "import mjplug.client.wire_driver; assert 'mujoco' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
