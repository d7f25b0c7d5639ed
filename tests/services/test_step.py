"""`~/step`: one request carries controls and messages, and brings back arrays and samples of the last boundary."""

import mujoco
import numpy as np
import pytest
from step_worlds import CARTS, carts, finish, refusal, send, step, token

from mjplug.plugin import RequestError
from mjplug.server.local_calls import LocalCall
from mjplug.services.stepping import service as stepping
from mjplug.testing import World
from mjplug_plugins.heartbeat import Heartbeat
from mjplug_plugins.joints import JointCommands, JointStatePublisher
from mjplug_schemas.mjplug_msgs import Sample, Step
from mjplug_schemas.mujoco_ros2_control_msgs import SetPause
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.std_msgs import Float64, Float64MultiArray, String


@pytest.fixture
def world():
    return carts()


def alone(controls, steps, observe):
    """The rows that MuJoCo alone gives."""
    model = mujoco.MjModel.from_xml_string(CARTS)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    rows = []
    for row in controls:
        data.ctrl[:] = row
        mujoco.mj_step(model, data, steps)
        rows.append(np.concatenate([np.ravel(getattr(data, name)) for name in observe]))
    return np.array(rows)


def rows(response):
    return np.array(response.observations).reshape(-1, sum(response.widths))


def test_one_action_is_held_for_all_its_steps(world):
    response = step(world, steps=5, ctrl=[1.0, -2.0], observe=["qpos", "qvel", "sensordata"])
    assert np.array_equal(rows(response), alone([[1.0, -2.0]], 5, ["qpos", "qvel", "sensordata"]))
    assert response.widths == (9, 8, 2)
    assert (response.step, response.stamp.nanosec, response.epoch) == (5, 10_000_000, 0)
    assert world.loop.paused


@pytest.mark.parametrize("steps", [1, 3])
def test_each_action_of_several_has_its_own_row_of_results(world, steps):
    controls = np.random.default_rng(1).normal(size=(50, 2))
    response = step(world, steps=steps, ctrl=controls.ravel(), observe=["qvel", "ctrl", "qpos"])
    assert np.array_equal(rows(response), alone(controls, steps, ["qvel", "ctrl", "qpos"]))
    assert world.simulation.step == 50 * steps


def test_actions_equal_single_requests_to_the_bit(world):
    controls = np.random.default_rng(2).normal(size=(20, 2))
    chunk = rows(step(world, ctrl=controls.ravel(), observe=["qpos", "qvel", "xpos"]))
    other = World(CARTS, paused=True)
    stepping.offer(other.host("mjplug"), other.loop, other.transport, other.topics, "mjplug")
    single = [rows(step(other, ctrl=row, observe=["qpos", "qvel", "xpos"]))[0] for row in controls]
    assert np.array_equal(chunk, single)


def test_without_controls_the_previous_ones_stay(world):
    step(world, ctrl=[3.0, 4.0])
    response = step(world, steps=2, observe=["ctrl", "ctrl"])
    assert list(response.observations) == [3.0, 4.0, 3.0, 4.0]
    assert response.widths == (2, 2)


def test_zero_steps_only_read_and_write(world):
    response = step(world, steps=0, ctrl=[1.0, 2.0], observe=["ctrl", "act", "qpos"])
    assert response.widths == (2, 0, 9)
    assert np.array_equal(response.observations, [1.0, 2.0, *world.data.qpos])
    assert world.simulation.step == 0


def test_poses_belong_to_the_positions_after_the_last_step(world):
    response = step(world, steps=100, ctrl=[5.0, 0.0], observe=["xpos", "qpos"])
    x, qpos = np.split(rows(response)[0], [3 * world.model.nbody])
    assert x.reshape(-1, 3)[1, 0] == qpos[0] != 0.0


def test_contact_forces_are_computed_when_they_are_observed(world):
    response = step(world, steps=500, observe=["cfrc_ext"])
    ball = rows(response).reshape(-1, 6)[3]
    weight = world.model.body_mass[3] * 9.81
    assert ball[5] == pytest.approx(weight, rel=1e-3)


def test_observing_does_not_change_the_motion(world):
    for name in ("xpos", "cfrc_ext", "subtree_com"):
        step(world, steps=7, ctrl=[1.0, 1.0], observe=[name])
    response = step(world, steps=0, observe=["qpos", "qvel"])
    assert np.array_equal(rows(response), alone([[1.0, 1.0]], 21, ["qpos", "qvel"]))


def test_every_observable_array_can_be_observed(world):
    from mjplug.services.stepping.arrays import OBSERVABLE

    response = step(world, observe=OBSERVABLE)
    assert len(response.observations) == sum(response.widths)
    assert response.widths == tuple(getattr(world.data, name).size for name in OBSERVABLE)


def test_inputs_are_handled_before_the_first_step(world):
    world.add(JointCommands, "arm", groups={"both": {"joints": ["a", "b"], "interface": "effort", "topic": "/force"}})
    command = Float64MultiArray(data=[2.0, 6.0])
    sample = Sample(topic="/force", type=command.TYPE, cdr=command.to_cdr())
    response = step(world, inputs=[sample], observe=["ctrl", "qvel"])
    assert list(response.observations)[:2] == [2.0, 3.0]
    assert response.observations[2] > 0.0


def test_inputs_may_be_json(world):
    world.add(JointCommands, "arm", groups={"one": {"joints": ["a"], "interface": "effort", "topic": "/force"}})
    response = step(world, inputs=[Sample(topic="/force", json_text='{"data": [1.5]}')], observe=["ctrl"])
    assert response.observations[0] == 1.5


def test_outputs_describe_the_last_boundary_whatever_the_rate_of_the_topic(world):
    world.add(JointStatePublisher, "joints", rate=1.0)
    response = step(world, steps=3, ctrl=[1.0, 0.0], outputs=["/joint_states"])
    (sample,) = response.outputs
    assert (sample.topic, sample.type, sample.fresh) == ("/joint_states", "sensor_msgs/msg/JointState", True)
    state = JointState.from_cdr(sample.cdr)
    assert state.header.stamp.nanosec == 6_000_000
    assert state.position == tuple(world.data.qpos[:2])
    # A sample is not published.
    assert world.published("/joint_states") == []


def test_a_topic_without_sampler_gives_the_newest_message_of_the_window(world):
    world.add(Heartbeat, "heart", update_rate=100.0, topic="/beat")
    world.transport.publishers["/beat"].matched = False
    (none,) = step(world, steps=4, outputs=["/beat"]).outputs
    (fresh,) = step(world, steps=1, outputs=["/beat"]).outputs
    (old,) = step(world, steps=8, outputs=["/beat"]).outputs
    assert (none.cdr, none.fresh) == (b"", False)
    assert fresh.fresh
    assert not old.fresh
    assert String.from_cdr(old.cdr).data.endswith("0.020000s")
    assert not world.transport.publishers["/beat"].matched


def test_a_timer_that_sleeps_without_subscribers_runs_for_outputs(world):
    host = world.host("watch")
    publisher = host.create_publisher(Float64, "/value")
    world.transport.publishers["/value"].matched = False
    host.create_timer(0.01, lambda: publisher.publish(Float64(data=host.step)), while_matched=publisher)
    world.step(20)
    (sample,) = step(world, steps=10, outputs=["/value"]).outputs
    assert (Float64.from_cdr(sample.cdr).data, sample.fresh) == (30.0, True)
    world.step(20)
    assert [message.data for message in world.published("/value")] == [25.0, 30.0]


def test_a_latched_topic_always_has_its_last_message(world):
    (sample,) = step(world, outputs=["/mjplug/epoch"]).outputs
    assert not sample.fresh
    assert sample.cdr


def test_two_publishers_of_one_topic_give_two_samples(world):
    world.add(JointStatePublisher, "one", topic="/states", joints=["a"])
    world.add(JointStatePublisher, "two", topic="/states", joints=["b"])
    names = [JointState.from_cdr(sample.cdr).name for sample in step(world, outputs=["/states"]).outputs]
    assert names == [("a",), ("b",)]


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"ctrl": [1.0]}, r"ctrl has 1 values; it must have k \* 2, because the model has 2 actuators"),
        ({"ctrl": [1.0, 2.0, 3.0]}, r"ctrl has 3 values; it must have k \* 2"),
        ({"ctrl": [0.0, 0.0, 0.0, float("nan")]}, r"ctrl\[3\] is nan \(row 1, actuator 1\); it must be finite"),
        ({"ctrl": [float("inf"), 0.0]}, r"ctrl\[0\] is inf"),
        ({"ctrl": [0.0, -1e10]}, r"ctrl\[1\] is -1e\+10"),
        ({"observe": ["qpos", "qpso"]}, "unknown array in observe 'qpso', did you mean 'qpos'"),
        ({"observe": ["qpos"] * 65}, "observe has 65 names; at most 64"),
        ({"observe": ["xpos"], "ctrl": [0.0] * 2 * (1 << 17) + [0.0] * 2}, "ctrl has 131073 rows; at most 131072"),
        ({"observe": ["xpos", "xmat"], "ctrl": [0.0] * 200_000}, "response would contain 4800000 observed values"),
        ({"outputs": ["/clok"]}, r"outputs\[0\]: unknown topic that the server publishes '/clok', did you mean"),
        ({"outputs": ["/clock"] * 65}, "outputs has 65 entries; at most 64"),
        ({"inputs": [Sample(topic="/clock", json_text="{}")]}, r"inputs\[0\]: unknown topic that the server reads"),
        ({"steps": 0, "ctrl": [0.0] * 4}, "steps is 0 with 2 actions"),
    ],
)
def test_a_wrong_request_changes_nothing(world, fields, reason):
    with pytest.raises(AssertionError, match=reason):
        raise AssertionError(refusal(world, **fields))


@pytest.mark.parametrize(
    ("sample", "reason"),
    [
        (Sample(topic="/force"), "exactly one of cdr and json_text"),
        (Sample(topic="/force", cdr=b"\0\1\0\0", json_text="{}"), "exactly one of cdr and json_text"),
        (Sample(topic="/force", cdr=b"\0\1\0\0\1"), r"std_msgs/msg/Float64MultiArray: "),
        (Sample(topic="/force", json_text='{"data": "x"}'), "data"),
        (Sample(topic="/force", json_text='{"data": [1]}', type="std_msgs/msg/String"), "is expected"),
        (Sample(topic="/force", cdr=bytes(70_000)), "the inputs have 70000 bytes; at most 65536"),
        (Sample(topic="/force", json_text=" " * 9000), "the inputs have 9015 bytes in JSON; at most 8192"),
    ],
)
def test_an_input_that_cannot_be_decoded_changes_nothing(world, sample, reason):
    world.add(JointCommands, "arm", groups={"one": {"joints": ["a"], "interface": "effort", "topic": "/force"}})
    good = Sample(topic="/force", json_text='{"data": [1.5]}')
    with pytest.raises(AssertionError, match=reason):
        raise AssertionError(refusal(world, ctrl=[1.0, 1.0], inputs=[good, sample]))


def test_an_input_that_a_plugin_refuses_prevents_the_steps(world):
    host = world.host("picky")

    def take(message):
        raise RequestError(f"{message.data:g} is too much")

    host.create_subscription(Float64, "/level", take)
    reason = refusal(world, ctrl=[1.0, 1.0], inputs=[Sample(topic="/level", cdr=Float64(data=9.0).to_cdr())])
    assert reason == "inputs[0] (/level): 9 is too much; no step was taken"


def test_steps_are_refused_while_running(world):
    world.call("/mjplug/set_pause", SetPause.Request(paused=False))
    call = finish(world, send(world, ctrl=[1.0, 1.0]))
    assert call.refusal == "the simulation is running; pause it first (~/set_pause, or mjplug sim pause)"


def test_a_divergence_ends_the_request_with_the_number_of_steps(world):
    world.model.actuator_gear[0, 0] = 100.0
    controls = np.zeros((10, 2))
    controls[4:] = 9e9, 0.0
    call = finish(world, send(world, ctrl=controls.ravel(), observe=["qpos"]))
    taken = world.simulation.step
    assert 4 <= taken < 10
    assert call.refusal.endswith(f"({taken} of 10 steps were taken)")
    assert np.isfinite(world.data.qpos).all()
    assert step(world, ctrl=[0.0, 0.0], observe=["qpos"]).step == taken + 1


def test_a_reset_ends_the_request(world):
    call = send(world, steps=1_000_000)
    world.loop.turn()
    world.reset()
    assert "cancelled: the world was reset" in call.refusal


def test_clock_is_published_once_per_request(world):
    world.published("/clock").clear()
    step(world, ctrl=[0.0] * 6)
    assert [message.clock.nanosec for message in world.published("/clock")] == [6_000_000]


def test_few_steps_are_taken_before_calls_that_were_posted_after_the_request(world):
    call = send(world, ctrl=[1.0, 0.0] * 3, observe=["qpos"])
    seen = []
    world.loop.inbox.post(lambda: seen.append(world.simulation.step))
    while not seen:
        world.loop.step(0)
    # A posted call ends the batch, so at least the first of the three actions has been taken.
    assert seen[0] >= 1
    finish(world, call)
    later = send(world)
    world.loop.step(0)
    assert later.answered
    assert world.simulation.step == 4


class EncodedCall(LocalCall):
    """A request in CDR."""

    form = "cdr"

    def respond_frame(self, frame):
        self.payload = frame.payload()
        super().respond_frame(frame)


@pytest.mark.parametrize("steps", [0, 1, 7])
@pytest.mark.parametrize("actions", [1, 3])
@pytest.mark.parametrize("observe", [[], ["qpos"], ["xpos", "act", "qvel", "qpos"]])
def test_a_response_in_cdr_equals_the_encoded_message(world, steps, actions, observe):
    if not steps and actions > 1:
        return
    other = World(CARTS, paused=True)
    stepping.offer(other.host("mjplug"), other.loop, other.transport, other.topics, "mjplug")
    for repeat in range(3):
        fields = {"steps": steps, "ctrl": [0.5 + repeat, -1.0] * actions, "observe": observe}
        call = EncodedCall(Step.Request(**fields))
        world.transport.deliver("/mjplug/step", call)
        assert finish(world, call).payload == step(other, **fields).to_cdr()


def test_a_long_request_in_cdr_keeps_its_results_while_others_wait(world):
    token(world, "one")
    calls = [EncodedCall(Step.Request(steps=100, observe=["qpos"]), {"owner": "one"}) for _ in range(3)]
    for call in calls:
        world.transport.deliver("/mjplug/step", call)
    for i, call in enumerate(calls, 1):
        response = finish(world, call).response
        assert response.step == 100 * i
        assert response.observations == tuple(alone([[0.0, 0.0]], 100 * i, ["qpos"])[0])


def test_a_fatal_error_of_mujoco_during_the_steps_of_a_request_ends_the_server(world, monkeypatch):
    def fail(*_):
        raise mujoco.FatalError("the stack is full")

    monkeypatch.setattr(mujoco, "mj_step", fail)
    send(world)
    world.loop.step(0)
    assert world.loop.stopping
    assert "the stack is full" in str(world.loop.failure)
