"""Topics through the bridge, both ways."""

import json
import struct
import threading

import pytest
import zenoh
from cli.client import Client
from waits import TIMEOUT, until
from zenoh.handlers import Callback

from mjplug.contracts.transport import LATCHED, Topic
from mjplug_schemas.geometry_msgs import Twist, Vector3
from mjplug_schemas.rosgraph_msgs import Clock
from mjplug_schemas.std_msgs import String, UInt64

pytestmark = pytest.mark.ros


@pytest.fixture(autouse=True)
def _mapped(shared_bridge):
    """All these tests share one bridge."""


def test_the_bytes_of_a_topic_arrive_as_they_are(ros, zenoh_client):
    sent = zenoh_client.listen("mujoco_heartbeat")
    inbox = ros.subscribe("/mujoco_heartbeat", "std_msgs/msg/String")
    arrived = [inbox.next() for _ in range(5)]
    numbers = [int(String.from_cdr(payload).data.split("#")[1].split()[0]) for payload in arrived]
    assert numbers == list(range(numbers[0], numbers[0] + 5))
    payloads = []
    while len(payloads) < 500 and (not payloads or not same(arrived[-1], payloads[-1])):
        payloads.append(sent.sample().payload.to_bytes())
    assert all(same(*pair) for pair in zip(arrived, payloads[-5:], strict=True))


def test_the_clock_arrives(ros):
    inbox = ros.subscribe("/clock", "rosgraph_msgs/msg/Clock", reliable=False)
    times = [Clock.from_cdr(inbox.next()).clock for _ in range(10)]
    seconds = [time.sec + 1e-9 * time.nanosec for time in times]
    assert seconds == sorted(set(seconds))
    assert seconds[-1] - seconds[0] == pytest.approx(0.09, abs=0.05)


def test_a_late_joiner_gets_the_last_message_of_a_latched_topic(ros, zenoh_client):
    zenoh_client.do("mjplug/reset_world")
    epoch = state(zenoh_client)["epoch"]
    assert epoch >= 1
    first = ros.subscribe("/mjplug/epoch", "std_msgs/msg/UInt64", latched=True)
    # The first message may arrive before the bridge has seen the reset.
    while (seen := UInt64.from_cdr(first.next()).data) != epoch:
        assert seen < epoch
    late = ros.subscribe("/mjplug/epoch", "std_msgs/msg/UInt64", latched=True)
    assert UInt64.from_cdr(late.next()).data == epoch


def test_a_latched_topic_is_subscribed_even_without_ros_subscribers(ros, bridge, sim):
    # Otherwise the next subscriber would get an old message of the previous subscriber.
    sim.publish(Topic("/a", String, LATCHED))
    bridge(sim.endpoint)
    with Client(sim.endpoint) as client:
        publisher = client.session.declare_publisher("a")
        until(lambda: publisher.matching_status.matching)


def test_messages_for_the_server_arrive(ros, zenoh_client):
    publish = ros.publisher("/probe/twist", "geometry_msgs/msg/Twist")
    before = state(zenoh_client)["twists"]
    publish(Twist(linear=Vector3(x=-12.625)).to_cdr())
    until(lambda: state(zenoh_client)["twists"] == before + 1)
    assert state(zenoh_client)["last_twist_x"] == -12.625


def test_a_message_from_ros_is_put_once_with_its_type(ros, zenoh_client):
    heard = zenoh_client.listen("probe/twist")
    # With this answer, the router knows the subscriber.
    state(zenoh_client)
    # So that the next one to come back is not an echo of an earlier one.
    payload = Twist(angular=Vector3(z=0.1)).to_cdr()
    ros.publisher("/probe/twist", "geometry_msgs/msg/Twist")(payload)
    sample = heard.sample()
    assert same(sample.payload.to_bytes(), payload)
    assert str(sample.encoding) == "application/cdr;geometry_msgs/msg/Twist"
    state(zenoh_client)
    assert heard.drain() == []


def test_the_server_has_no_subscriber_without_ros_subscribers(ros, zenoh_client):
    changes = threading.Condition()
    matched = []

    def changed(status):
        with changes:
            matched.append(status.matching)
            changes.notify_all()

    publisher = zenoh_client.session.declare_publisher("mujoco_heartbeat")
    # The subscription of a test before this one may not be gone yet.
    listener = publisher.declare_matching_listener(Callback(changed, indirect=False))
    with changes:
        assert changes.wait_for(lambda: not matched or not matched[-1], TIMEOUT)
    inbox = ros.subscribe("/mujoco_heartbeat", "std_msgs/msg/String")
    with changes:
        assert changes.wait_for(lambda: matched and matched[-1], TIMEOUT)
    inbox.next()
    ros.forget()
    with changes:
        assert changes.wait_for(lambda: not matched[-1], TIMEOUT)
    listener.undeclare()
    publisher.undeclare()


def test_what_is_no_cdr_is_kept_from_ros(ros, zenoh_client, shared_bridge):
    inbox = ros.subscribe("/mujoco_heartbeat", "std_msgs/msg/String")
    inbox.next()
    zenoh_client.put("mujoco_heartbeat", '{"data": "fake"}', zenoh.Encoding.APPLICATION_JSON)
    zenoh_client.put("mujoco_heartbeat", b"fake")
    other = zenoh.Encoding.APPLICATION_CDR.with_schema("std_msgs/msg/Bool")
    zenoh_client.put("mujoco_heartbeat", struct.pack("<4sI4s", b"\0\1\0\0", 4, b"fak\0"), other)
    genuine = String(data="fake?").to_cdr()
    zenoh_client.put("mujoco_heartbeat", genuine)
    payload = inbox.next()
    while not same(payload, genuine):
        assert b"fak" not in payload
        payload = inbox.next()
    shared_bridge.wait_for(r"WARN.*dropped a message on the key mujoco_heartbeat.*encoding is 'application/json'")
    assert shared_bridge.log.text.count("dropped a message") == 1


def same(arrived, sent):
    """Whether bytes are those that were sent, but for the zeros up to a multiple of 4 that some middlewares add."""
    return arrived in (sent, sent + bytes(-len(sent) % 4))


def state(client):
    return json.loads(client.do("probe/state"))
