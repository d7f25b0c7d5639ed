"""`~/rollout`: sequences of controls in copies of the state, equal to steps of the server, which does not change."""

import threading

import mujoco
import numpy as np
import pytest

from mjplug.services.rollout import service as rollout
from mjplug.services.rollout.batch import Batch, Sequences
from mjplug.services.states import service as states
from mjplug.testing import World
from mjplug_schemas.mjplug_msgs import Rollout, SaveState

PUSHER = """
<mujoco>
  <option timestep="0.005"/>
  <worldbody>
    <geom type="plane" size="5 5 .1"/>
    <body name="hand" mocap="true" pos="0 0 3"/>
    <body name="pusher" pos="0 0 .2"><joint name="push" type="slide" axis="1 0 0" damping="1"/>
      <geom type="box" size=".1 .2 .1"/></body>
    <body name="box" pos=".35 .02 .1"><freejoint/><geom type="box" size=".1 .1 .1"/></body>
    <body name="loose" pos="0 1 2"><joint type="slide" axis="0 0 1"/><geom type="sphere" size=".1"/></body>
  </worldbody>
  <actuator><position name="push" joint="push" kp="200"/></actuator>
  <equality><weld name="hold" body1="hand" body2="loose" active="false"/></equality>
  <sensor><jointpos joint="push"/></sensor>
</mujoco>
"""


@pytest.fixture
def world(tmp_path):
    world = World(PUSHER, paused=True)
    host = world.host("mjplug")
    saved = states.offer(host, world.loop, 0, "1.2.3", states.Limits(), tmp_path)
    close = rollout.offer(host, world.loop, saved.vector)
    yield world
    close()
    saved.close()


def ask(world, **fields):
    call = world.call("/mjplug/rollout", Rollout.Request(**fields))
    for _ in range(2000):
        if call.answered:
            return call
        world.loop.inbox.wait(0.05)
    raise AssertionError("no answer")


def simulate(world, controls, steps=1, observe=("qpos", "qvel")):
    call = ask(world, nbatch=len(controls), steps=steps, ctrl=controls.ravel(), observe=observe)
    assert call.refusal is None, call.refusal
    return np.array(call.response.observations).reshape(*controls.shape[:2], sum(call.response.widths)), call.response


def stepped(world, controls, steps):
    """The rows that the server would give, from a copy of its state."""
    model, rows = world.model, []
    for sequence in controls:
        data = mujoco.MjData(model)
        state = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION))
        mujoco.mj_getState(model, world.data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        mujoco.mj_setState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        for row in sequence:
            data.ctrl[:] = row
            mujoco.mj_step(model, data, steps)
            rows.append(np.concatenate([data.qpos, data.qvel]))
    return np.array(rows).reshape(*controls.shape[:2], -1)


@pytest.mark.parametrize("steps", [1, 4])
def test_each_sequence_equals_steps_from_the_present_state_to_the_bit(world, steps):
    world.data.ctrl[:] = 0.5
    world.data.eq_active[:] = 1
    world.data.mocap_pos[0] = 0.0, 1.0, 1.5
    world.step(80)
    assert world.data.ncon > 4
    controls = np.random.default_rng(5).uniform(-0.5, 1.0, (7, 30, 1))
    controls[3] = controls[2]
    rows, response = simulate(world, controls, steps)
    assert np.array_equal(rows, stepped(world, controls, steps))
    assert np.array_equal(rows[2], rows[3])
    assert not np.array_equal(rows[0], rows[1])
    assert response.message == "simulated 7 sequences of 30 actions without plugins"


@pytest.mark.parametrize("file", [False, True])
def test_sequences_may_start_from_a_saved_state(world, file):
    world.data.ctrl[:] = 0.4
    world.step(90)
    call = world.call("/mjplug/save_state", SaveState.Request(name="begin", file=file))
    while not call.answered:
        world.loop.inbox.wait(0.05)
    assert call.refusal is None
    controls = np.random.default_rng(7).uniform(-0.5, 1.0, (3, 10, 1))
    expected = stepped(world, controls, 2)
    world.step(33)
    call = ask(world, name="begin", file=file, nbatch=3, steps=2, ctrl=controls.ravel(), observe=["qpos", "qvel"])
    assert np.array_equal(np.reshape(call.response.observations, (3, 10, -1)), expected)


def test_the_server_itself_does_not_change(world):
    world.step(10)
    before = world.data.qpos.copy(), world.data.qvel.copy(), world.data.ctrl.copy(), world.simulation.step
    simulate(world, np.ones((3, 20, 1)))
    after = world.data.qpos, world.data.qvel, world.data.ctrl, world.simulation.step
    assert all(np.array_equal(one, other) for one, other in zip(before, after, strict=True))


def test_large_batches_are_simulated_in_parts(world, monkeypatch):
    controls = np.random.default_rng(6).uniform(-0.5, 1.0, (9, 5, 1))
    whole, _ = simulate(world, controls)
    monkeypatch.setattr("mjplug.services.rollout.batch._CHUNK_VALUES", 300)
    parts, _ = simulate(world, controls)
    assert np.array_equal(whole, parts)


def test_sensors_and_controls_can_be_observed(world):
    controls = np.linspace(0.0, 1.0, 6).reshape(2, 3, 1)
    rows, response = simulate(world, controls, 2, ("ctrl", "sensordata", "act", "ctrl"))
    assert response.widths == (1, 1, 0, 1)
    assert np.array_equal(rows[..., 0], controls[..., 0])
    assert np.array_equal(rows[..., 0], rows[..., 2])


def test_a_sequence_that_diverges_is_named(world):
    world.model.actuator_gainprm[0, 0] = 1e12
    controls = np.zeros((3, 40, 1))
    controls[1] = 9e9
    _, response = simulate(world, controls)
    assert response.message.endswith("1 of them diverged, and their rows are invalid: 1")


def test_a_sequence_that_ends_early_with_finite_values_is_named(world):
    # An acceleration above mjMAXVAL, which ends the sequence; the velocity stays far below it.
    world.model.opt.timestep = 1e-4
    world.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    world.model.actuator_gainprm[0, 0] = 1e12
    controls = np.zeros((4, 20, 1))
    controls[2, 10:] = 10.0
    rows, response = simulate(world, controls)
    assert np.isfinite(rows).all()
    assert np.array_equal(rows[2, 10], rows[2, -1])
    assert response.message.endswith("1 of them diverged, and their rows are invalid: 2")


def test_sequences_that_end_at_a_late_time_are_not_named(world):
    world.data.time = 2e9
    _, response = simulate(world, np.zeros((2, 300, 1)))
    assert "diverged" not in response.message


def test_a_sequence_whose_states_need_too_much_memory_is_refused(world, monkeypatch):
    monkeypatch.setattr("mjplug.services.rollout.batch.MAX_RECORDED", 100_000)
    values = 1 + world.model.nq + world.model.nv + world.model.nsensordata + world.model.nu
    values += world.model.neq + 7 * world.model.nmocap
    most = 100_000 // values
    assert ask(world, ctrl=[0.0], steps=most).refusal is None
    refusal = ask(world, ctrl=[0.0], steps=most + 1).refusal
    assert refusal.startswith(f"a sequence has 1 * {most + 1} steps; at most {most} are accepted for this model")


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"nbatch": 0, "ctrl": [1.0]}, "nbatch is 0; it must be at least 1"),
        ({"nbatch": 2, "ctrl": [1.0]}, "ctrl has 1 values; it must have 2 * k * 1 for 2 sequences of k actions"),
        ({"nbatch": 2}, "ctrl has 0 values; it must have 2 * k * 1 for 2 sequences of k actions"),
        ({"ctrl": [float("nan")]}, "ctrl[0] is nan (row 0, actuator 0); it must be finite"),
        ({"ctrl": [1.0], "steps": 0}, "steps is 0; it must be at least 1"),
        ({"ctrl": [1.0], "steps": 1_000_001}, "a sequence has 1 * 1000001 steps; at most 1000000 are accepted"),
        ({"ctrl": [1.0], "name": "none"}, "unknown state 'none'"),
        ({"ctrl": [1.0], "name": "a/b"}, "'a/b' cannot be the name of a state"),
        ({"ctrl": [1.0], "observe": ["xpos"]}, "unknown array in observe 'xpos'"),
        ({"ctrl": [1.0] * 300_000, "observe": ["qpos"]}, "the response would contain 2700000 observed values"),
    ],
)
def test_wrong_requests_are_refused_with_a_sentence(world, fields, reason):
    assert ask(world, **fields).refusal.startswith(reason)


def test_the_number_of_waiting_requests_is_limited(world, monkeypatch):
    monkeypatch.setattr("mjplug.services.rollout.service.MAX_WAITING", 2)
    go, run = threading.Event(), Batch.run
    monkeypatch.setattr(Batch, "run", lambda *arguments: go.wait(60.0) and run(*arguments))
    calls = [world.call("/mjplug/rollout", Rollout.Request(ctrl=[1.0])) for _ in range(4)]
    assert [call.refusal is not None for call in calls[2:]] == [True, True]
    assert calls[2].refusal.startswith("busy: 2 rollouts are waiting")
    go.set()
    while world.loop.scheduler.waiting:
        world.loop.inbox.wait(0.05)
    assert calls[0].response.success
    assert ask(world, ctrl=[1.0]).response.success


def test_a_batch_can_be_ended_between_its_parts(world, monkeypatch):
    monkeypatch.setattr("mjplug.services.rollout.batch._CHUNK_VALUES", 1)
    start = np.empty(mujoco.mj_stateSize(world.model, mujoco.mjtState.mjSTATE_INTEGRATION))
    mujoco.mj_getState(world.model, world.data, start, mujoco.mjtState.mjSTATE_INTEGRATION)
    asked = []
    batch = Batch(world.model, 1)
    batch.run(Sequences(start, np.zeros((10, 1, 1)), 1, ("qpos",)), lambda: asked.append(1) or len(asked) > 3)
    batch.close()
    assert len(asked) == 4
