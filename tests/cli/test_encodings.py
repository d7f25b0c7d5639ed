"""Requests are answered in the encoding they came in, and topics are there in both."""

import json
import struct

import pytest
import zenoh
from cli.client import JSON, wrench, wrenches
from zenoh.handlers import Callback

from mjplug_schemas.geometry_msgs import Twist, Vector3
from mjplug_schemas.mujoco_ros2_control_msgs import ApplyExternalWrench, SetPause, StepSimulation
from mjplug_schemas.rosgraph_msgs import Clock

CDR = zenoh.Encoding.APPLICATION_CDR
PUSH = ApplyExternalWrench.Request.from_json(
    json.dumps(wrenches(wrench("base_link", force=(10.0, 0.0, 0.0), seconds=0.01)))
)


def test_a_push_in_cdr_is_answered_in_cdr_with_the_type_of_the_response(world):
    stated = CDR.with_schema("mujoco_ros2_control_msgs/srv/ApplyExternalWrench")
    push = world.client.send("external_wrench/apply_wrench", PUSH.to_cdr(), stated)
    world.step(5)
    answer = push.answer()
    assert answer.encoding == "application/cdr;mujoco_ros2_control_msgs/srv/ApplyExternalWrench_Response"
    assert ApplyExternalWrench.Response.from_cdr(answer.payload) == ApplyExternalWrench.Response(
        success=True, message="applied 1 wrench, the longest for 0.01 s"
    )
    assert world.state()["qvel"][0] == pytest.approx(10.0 / 2 * 0.01, rel=1e-9)


def test_a_push_of_a_ros_2_node_is_answered_as_rmw_zenoh_answers(world):
    services = {entry["key"]: entry for entry in world.client.ask("mjplug/interfaces")["services"]}
    # Sequence number, time of sending, and who sent it.
    attachment = struct.pack("<qqB", 7, 1_700_000_000_000_000_000, 16) + bytes(range(16))
    push = world.client.send(services["external_wrench/apply_wrench"]["ros2_key"], PUSH.to_cdr(), None, attachment)
    world.step(4)
    assert not push.answered
    world.step(1)
    answer = push.answer()
    assert ApplyExternalWrench.Response.from_cdr(answer.payload).success is True
    sequence_number, _, size = struct.unpack_from("<qqB", answer.attachment)
    assert (sequence_number, size, answer.attachment[17:]) == (7, 16, bytes(range(16)))


@pytest.mark.parametrize(
    "stated", [None, CDR, CDR.with_schema("mujoco_ros2_control_msgs/srv/SetPause_Request")], ids=str
)
def test_cdr_is_recognised_with_and_without_an_encoding(world, stated):
    answer = world.client.send("mjplug/set_pause", SetPause.Request(paused=True).to_cdr(), stated).answer()
    assert SetPause.Response.from_cdr(answer.payload).message == "the simulation is already paused"


@pytest.mark.parametrize("stated", [None, JSON, zenoh.Encoding.TEXT_PLAIN, zenoh.Encoding.ZENOH_STRING], ids=str)
def test_json_is_recognised_with_and_without_an_encoding(world, stated):
    answer = world.client.send("mjplug/set_pause", '{"paused": true}', stated).answer()
    assert (answer.encoding, answer.json["message"]) == ("application/json", "the simulation is already paused")


def test_a_request_without_payload_has_the_initial_values_and_is_answered_in_json(world):
    answer = world.client.send("mjplug/reset_world").answer()
    assert (answer.encoding, answer.json) == (
        "application/json",
        {"success": True, "message": "the world was reset to its initial state"},
    )


def test_a_refusal_comes_in_the_encoding_of_the_request(world):
    payload = StepSimulation.Request(steps=0).to_cdr()
    answer = world.client.send("mjplug/step_simulation", payload, CDR).answer()
    assert StepSimulation.Response.from_cdr(answer.payload) == StepSimulation.Response(
        success=False, message="steps is 0; it must be at least 1"
    )


def test_a_topic_is_cdr_on_its_key_and_json_beside_it_with_the_encodings_stated(world):
    as_cdr, as_json = world.client.listen("clock"), world.client.listen("clock/@json")
    # A first listener gets the time at once.
    first, other = as_cdr.sample(), as_json.sample()
    assert str(first.encoding) == "application/cdr;rosgraph_msgs/msg/Clock"
    assert str(other.encoding) == "application/json"
    state = world.state()
    assert Clock.from_cdr(first.payload.to_bytes()).clock.to_ns() == state["time_ns"]
    stamp = json.loads(other.payload.to_bytes())["clock"]
    assert stamp["sec"] * 10**9 + stamp["nanosec"] == state["time_ns"]


def test_subscribed_topics_take_cdr_and_json(world):
    before = world.state()["twists"]
    client = world.client
    client.put("probe/twist", Twist(linear=Vector3(x=1.0)).to_cdr(), CDR)
    assert (world.state()["twists"], world.state()["last_twist_x"]) == (before + 1, 1.0)
    client.put("probe/twist", '{"linear": {"x": 2.0}}', JSON)
    assert (world.state()["twists"], world.state()["last_twist_x"]) == (before + 2, 2.0)
    client.put("probe/twist/@json", '{"linear": {"x": 3.0}}')
    assert (world.state()["twists"], world.state()["last_twist_x"]) == (before + 3, 3.0)


def test_everything_readable_is_one_subscription_away(world):
    samples = world.client.listen("**/@json")
    seen = set()
    while not {"clock/@json", "mujoco_heartbeat/@json"} <= seen:
        world.step(500)
        seen.add(str(samples.sample().key_expr))
    assert seen <= {"clock/@json", "mujoco_heartbeat/@json"}


def test_asking_everybody_everything_calls_no_service(world):
    world.step(3)
    before = world.state()
    replies = world.client.session.get("**", timeout=10.0)
    texts = {(reply.ok or reply.err).payload.to_string() for reply in replies}
    services = {entry["key"] for entry in world.client.ask("mjplug/interfaces")["services"]}
    assert {f"{key} is a service; query exactly this key to call it" for key in services} <= texts
    after = world.state()
    assert (after["step"], after["epoch"], after["qpos"]) == (before["step"], before["epoch"], before["qpos"])


def test_late_subscribers_get_the_number_of_resets(world):
    latest = []
    config = zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1)
    subscriber = zenoh.ext.declare_advanced_subscriber(
        world.client.session, "mjplug/epoch/@json", Callback(latest.append), history=config
    )
    world.client.do("mjplug/reset_world")
    epoch = world.state()["epoch"]
    subscriber.undeclare()
    assert json.loads(latest[-1].payload.to_bytes())["data"] == epoch
