"""Topics on real Zenoh: one server on 127.0.0.1, clients that are plain Zenoh sessions."""

import json
import logging
import queue
import threading

import pytest
import zenoh
from waits import TIMEOUT, until
from zenoh.ext import HistoryConfig, declare_advanced_publisher, declare_advanced_subscriber

from mjplug.contracts.cdr_frame import CdrFrame
from mjplug.contracts.transport import DEFAULT, LATCHED, QoS, Topic
from mjplug.errors import WireError
from mjplug_schemas.geometry_msgs import Twist, Vector3
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.std_msgs import Float64, String

HELLO = String(data="hello")
HELLO_CDR = b"\0\1\0\0\x06\0\0\0hello\0"


class Matches:
    """Counts the calls of `on_matched`."""

    def __init__(self):
        self._calls = threading.Semaphore(0)

    def __call__(self):
        self._calls.release()

    def wait(self, count=1):
        for _ in range(count):
            assert self._calls.acquire(timeout=TIMEOUT)

    def is_exhausted(self):
        return not self._calls.acquire(blocking=False)


@pytest.fixture
def matches():
    return Matches()


def test_a_topic_is_cdr_on_its_key_and_json_beside_it(network, client, matches):
    publisher = network.open_publisher(Topic("/robot1/chatter", String, DEFAULT), matches)
    cdr, readable = client.listen("robot1/chatter"), client.listen("robot1/chatter/@json")
    matches.wait(2)
    publisher.publish(HELLO)
    sample = cdr.get(timeout=TIMEOUT)
    assert bytes(sample.payload) == HELLO_CDR
    assert str(sample.encoding) == "application/cdr;std_msgs/msg/String"
    sample = readable.get(timeout=TIMEOUT)
    assert json.loads(bytes(sample.payload)) == {"data": "hello"}
    assert str(sample.encoding) == "application/json"


def test_a_listener_to_everything_readable_and_one_to_everything_see_each_message_once(network, client, matches):
    chatter = network.open_publisher(Topic("/chatter", String, DEFAULT), matches)
    number = network.open_publisher(Topic("/a/b/number", Float64, DEFAULT), matches)
    everything, readable = client.listen("**"), client.listen("**/@json")
    matches.wait(4)
    chatter.publish(HELLO)
    number.publish(Float64(data=0.5))
    chatter.publish(String(data="end"))
    seen = [everything.get(timeout=TIMEOUT) for _ in range(3)]
    assert [str(sample.key_expr) for sample in seen] == ["chatter", "a/b/number", "chatter"]
    seen = [readable.get(timeout=TIMEOUT) for _ in range(3)]
    assert [str(sample.key_expr) for sample in seen] == ["chatter/@json", "a/b/number/@json", "chatter/@json"]
    assert everything.empty()
    assert readable.empty()


def test_a_publisher_is_matched_from_its_first_to_its_last_subscriber(network, client_of, matches):
    publisher = network.open_publisher(Topic("/chatter", String, DEFAULT), matches)
    assert not publisher.matched
    publisher.publish(HELLO)
    first = client_of(network.session.endpoint)
    first.listen("chatter")
    matches.wait()
    assert publisher.matched
    first.close()
    until(lambda: not publisher.matched)
    second = client_of(network.session.endpoint)
    samples = second.listen("chatter/@json")
    matches.wait()
    publisher.publish(String(data="second"))
    assert json.loads(bytes(samples.get(timeout=TIMEOUT).payload)) == {"data": "second"}
    assert matches.is_exhausted()


def test_a_listener_that_was_there_first_matches(network, client, matches):
    samples = client.listen("chatter")
    client.settle()
    publisher = network.open_publisher(Topic("/chatter", String, DEFAULT), matches)
    matches.wait()
    publisher.publish(HELLO)
    assert bytes(samples.get(timeout=TIMEOUT).payload) == HELLO_CDR


def test_a_frame_reaches_both_kinds_of_listeners(network, client, matches):
    publisher = network.open_publisher(Topic("/joint_states", JointState, DEFAULT), matches)
    cdr, readable = client.listen("joint_states"), client.listen("joint_states/@json")
    matches.wait(2)
    frame = CdrFrame(JointState(name=("a", "b"), position=(0.0, 0.0)))
    frame.view("position")[:] = 0.25, -0.5
    publisher.publish_frame(frame)
    assert JointState.from_cdr(bytes(cdr.get(timeout=TIMEOUT).payload)).position == (0.25, -0.5)
    assert json.loads(bytes(readable.get(timeout=TIMEOUT).payload))["position"] == [0.25, -0.5]


@pytest.mark.parametrize("reliability", ["reliable", "best_effort"])
@pytest.mark.parametrize("key", ["robot_description", "robot_description/@json"])
def test_a_late_joiner_gets_what_is_latched(network, client, key, reliability):
    qos = QoS(depth=2, reliability=reliability, durability="transient_local")
    publisher = network.open_publisher(Topic("/robot_description", String, qos))
    assert publisher.matched, "a latched topic is written for those who come later"
    for text in ("one", "two", "three"):
        publisher.publish(String(data=text))
    samples = queue.SimpleQueue()
    subscriber = declare_advanced_subscriber(
        client.session,
        key,
        zenoh.handlers.Callback(samples.put, indirect=False),
        history=HistoryConfig(detect_late_publishers=True),
    )
    decode = String.from_json if key.endswith("@json") else String.from_cdr
    assert [decode(bytes(samples.get(timeout=TIMEOUT).payload)).data for _ in range(2)] == ["two", "three"]
    publisher.publish(String(data="four"))
    assert decode(bytes(samples.get(timeout=TIMEOUT).payload)).data == "four"
    subscriber.undeclare()


def test_a_client_without_history_reads_what_is_latched_with_a_query(network, client):
    publisher = network.open_publisher(Topic("/robot_description", String, LATCHED))
    publisher.publish(String(data="old"))
    publisher.publish(HELLO)
    answer = client.call("robot_description")
    assert (answer.payload, answer.encoding) == (HELLO_CDR, "application/cdr;std_msgs/msg/String")
    assert client.call("robot_description/@json").json == {"data": "hello"}


@pytest.fixture
def subscribed(network):
    """The messages of /cmd_vel as they are delivered."""
    messages = queue.SimpleQueue()
    network.open_subscription(Topic("/cmd_vel", Twist, DEFAULT), messages.put)
    return messages


FORWARD = Twist(linear=Vector3(x=0.5))


@pytest.mark.parametrize(
    ("key", "payload", "encoding"),
    [
        ("cmd_vel", FORWARD.to_cdr(), None),
        ("cmd_vel", FORWARD.to_cdr(), "application/cdr"),
        ("cmd_vel", FORWARD.to_cdr(), "application/cdr;geometry_msgs/msg/Twist"),
        ("cmd_vel", b'{"linear": {"x": 0.5}}', None),
        ("cmd_vel", b'{"linear": {"x": 0.5}}', "application/json"),
        ("cmd_vel/@json", b'{"linear": {"x": 0.5}}', None),
        ("cmd_vel/@json", b'{"linear": {"x": 0.5}}', "text/json"),
    ],
)
def test_a_subscription_takes_cdr_and_json(client, subscribed, key, payload, encoding):
    client.publisher(key).put(payload, encoding=encoding)
    assert subscribed.get(timeout=TIMEOUT) == FORWARD


def test_bad_samples_are_counted_and_logged_and_the_next_good_one_is_delivered(client, subscribed, caplog):
    publisher = client.publisher("cmd_vel")
    with caplog.at_level(logging.WARNING):
        publisher.put(b'{"linear": {"y": "fast"}}')
        publisher.put(b"\0\1\0\0\1")
        publisher.put(b"")
        publisher.put(bytes(10 << 20))
        publisher.delete()
        publisher.put(FORWARD.to_cdr())
        assert subscribed.get(timeout=TIMEOUT) == FORWARD
    assert subscribed.empty()
    (line,) = caplog.messages
    assert line.startswith("topic /cmd_vel: a sample was refused (1 so far): geometry_msgs/msg/Twist")
    assert "linear.y" in line


def test_samples_over_the_limit_are_not_decoded(client, network):
    messages = queue.SimpleQueue()
    network.open_subscription(Topic("/chatter", String, DEFAULT), messages.put)
    publisher = client.publisher("chatter")
    publisher.put(String(data="x" * (1 << 20)).to_cdr())
    largest = String(data="x" * ((1 << 20) - 9))
    assert len(largest.to_cdr()) == 1 << 20
    publisher.put(largest.to_cdr())
    assert messages.get(timeout=TIMEOUT) == largest
    assert messages.empty()


def test_a_deliver_that_fails_is_logged_and_the_next_message_is_delivered(client, network, caplog):
    messages = queue.SimpleQueue()

    def deliver(message):
        if message.data == "bad":
            raise RuntimeError("no room")
        messages.put(message)

    network.open_subscription(Topic("/chatter", String, DEFAULT), deliver)
    publisher = client.publisher("chatter")
    publisher.put(String(data="bad").to_cdr())
    publisher.put(HELLO_CDR)
    assert messages.get(timeout=TIMEOUT) == HELLO
    assert "topic /chatter: delivering a message failed" in caplog.messages


@pytest.mark.parametrize("reliability", ["reliable", "best_effort"])
def test_a_latched_subscription_gets_what_was_published_before(client, network, reliability):
    publisher = declare_advanced_publisher(
        client.session, "map", cache=zenoh.ext.CacheConfig(1), publisher_detection=True
    )
    publisher.put(HELLO_CDR)
    messages = queue.SimpleQueue()
    qos = QoS(depth=1, reliability=reliability, durability="transient_local")
    network.open_subscription(Topic("/map", String, qos), messages.put)
    assert messages.get(timeout=TIMEOUT) == HELLO
    publisher.undeclare()


def test_a_topic_has_one_type(network):
    network.open_publisher(Topic("/x", String, DEFAULT))
    with pytest.raises(
        WireError,
        match="topic /x already exists with type std_msgs/msg/String; it cannot also have type std_msgs/msg/Float64",
    ):
        network.open_subscription(Topic("/x", Float64, DEFAULT), print)


def test_after_the_close_a_publisher_publishes_nothing(network, client, matches):
    live = network.open_publisher(Topic("/x", String, DEFAULT), matches)
    latched = network.open_publisher(Topic("/y", String, LATCHED))
    client.listen("x")
    matches.wait()
    network.close()
    network.close()
    assert not live.matched
    assert not latched.matched
    live.publish(HELLO)
    latched.publish(HELLO)
