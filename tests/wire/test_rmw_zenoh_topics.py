"""Topics on the keys of rmw_zenoh: a server on 127.0.0.1, and bare Zenoh peers that check bytes."""

import queue
import time

import pytest
import zenoh
from waits import TIMEOUT, until
from wire.ros_peer import HEARTBEAT, HEARTBEAT_KEY, WHO, Matched, tokens
from zenoh.ext import HistoryConfig, RecoveryConfig, declare_advanced_publisher, declare_advanced_subscriber
from zenoh.handlers import Callback

from mjplug.contracts.transport import DEFAULT, LATCHED, LATEST, Topic
from mjplug.wire.rmw_zenoh.attachment import Attachment
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.rmw_zenoh.tokens import gid
from mjplug_schemas.geometry_msgs import Twist, Vector3
from mjplug_schemas.std_msgs import String


@pytest.fixture
def network(new_ros_network):
    return new_ros_network()


def test_a_message_has_the_bytes_of_the_worked_example(network, client):
    matched = Matched()
    publisher = network.open_publisher(HEARTBEAT, matched)
    assert not publisher.matched
    samples = client.listen(HEARTBEAT_KEY)
    matched.wait()
    before = time.time_ns()
    publisher.publish(String(data="alive"))
    sample = samples.get(timeout=TIMEOUT)
    assert str(sample.key_expr) == HEARTBEAT_KEY
    assert bytes(sample.payload) == bytes.fromhex("00010000 06000000 616c69766500")
    attachment = bytes(sample.attachment)
    (token,) = tokens(client, "@ros2_lv/*/*/*/*/MP/**")
    assert len(attachment) == 33
    assert attachment[:8] == (1).to_bytes(8, "little")
    assert before <= int.from_bytes(attachment[8:16], "little") <= time.time_ns()
    assert attachment[16:] == b"\x10" + gid(token)


def test_numbers_count_only_what_is_sent(network, client):
    matched = Matched()
    publisher = network.open_publisher(HEARTBEAT, matched)
    numbers = []
    for _ in range(2):
        publisher.publish(String(data="for nobody"))
        samples = queue.SimpleQueue()
        subscriber = client.session.declare_subscriber(HEARTBEAT_KEY, Callback(samples.put, indirect=False))
        matched.wait()
        for text in ("a", "b"):
            publisher.publish(String(data=text))
            sample = samples.get(timeout=TIMEOUT)
            numbers.append(Attachment.from_bytes(bytes(sample.attachment)).sequence_number)
        subscriber.undeclare()
        until(lambda: not publisher.matched)
    assert numbers == [1, 2, 3, 4]


def test_plain_clients_and_nodes_get_the_same_payload(network, client):
    matched = Matched()
    publisher = network.open_publisher(HEARTBEAT, matched)
    plain, ros = client.listen("mujoco_heartbeat"), client.listen(HEARTBEAT_KEY)
    matched.wait()
    matched.wait()
    publisher.publish(String(data="both"))
    first, second = plain.get(timeout=TIMEOUT), ros.get(timeout=TIMEOUT)
    assert bytes(first.payload) == bytes(second.payload) == String(data="both").to_cdr()
    assert bytes(first.attachment)[:8] == bytes(second.attachment)[:8]
    assert (str(first.encoding), str(second.encoding)) == ("application/cdr;std_msgs/msg/String", "zenoh/bytes")


@pytest.mark.parametrize("reliability", ["reliable", "best_effort"])
def test_a_late_node_gets_the_last_latched_message_as_it_was_sent(network, client, reliability):
    topic = Topic("/robot_description", String, type(LATCHED)(1, reliability, "transient_local"))
    publisher = network.open_publisher(topic)
    for text in ("old", "new"):
        publisher.publish(String(data=text))
    client.settle()
    samples = queue.SimpleQueue()
    subscriber = declare_advanced_subscriber(
        client.session,
        RosSettings().data_key("/robot_description", String),
        samples.put,
        history=HistoryConfig(detect_late_publishers=True, max_samples=1),
        recovery=RecoveryConfig(periodic_queries=None, heartbeat=True) if reliability == "reliable" else None,
        subscriber_detection=True,
    )
    sample = samples.get(timeout=TIMEOUT)
    assert String.from_cdr(bytes(sample.payload)).data == "new"
    attachment = Attachment.from_bytes(bytes(sample.attachment))
    (token,) = tokens(client, "@ros2_lv/*/*/*/*/MP/**")
    assert (attachment.sequence_number, attachment.gid) == (2, gid(token))
    publisher.publish(String(data="live"))
    live = samples.get(timeout=TIMEOUT)
    assert String.from_cdr(bytes(live.payload)).data == "live"
    assert Attachment.from_bytes(bytes(live.attachment)).sequence_number == 3
    subscriber.undeclare()


@pytest.mark.parametrize("type_hash", [RosSettings().type_hash(Twist), "TypeHashNotSupported"])
def test_messages_of_nodes_with_our_hash_and_of_humble_are_read(network, client, type_hash):
    got = queue.SimpleQueue()
    network.open_subscription(Topic("/cmd_vel", Twist, LATEST), got.put)
    twist = Twist(linear=Vector3(x=0.5))
    publisher = client.publisher(f"0/cmd_vel/geometry_msgs::msg::dds_::Twist_/{type_hash}")
    publisher.put(b"\0\1\0\0not a twist", attachment=Attachment(1, 1, WHO).to_bytes())
    publisher.put(twist.to_cdr(), encoding="image/png", attachment=Attachment(2, 1, WHO).to_bytes())
    assert got.get(timeout=TIMEOUT) == twist


def test_a_message_of_another_definition_is_counted_and_not_decoded(network, client):
    messages = queue.SimpleQueue()
    network.open_subscription(Topic("/cmd_vel", Twist, DEFAULT), messages.put)
    key = "0/cmd_vel/geometry_msgs::msg::dds_::Twist_"
    foreign = client.publisher(f"{key}/RIHS01_{'0' * 64}")
    ours = client.publisher(f"{key}/{RosSettings().type_hash(Twist)}")
    foreign.put(Twist(linear=Vector3(x=1.0)).to_cdr())
    until(lambda: network.refused()["/cmd_vel"] == 1)
    ours.put(Twist(linear=Vector3(x=2.0)).to_cdr())
    assert messages.get(timeout=TIMEOUT).linear.x == 2.0
    assert messages.empty()


def test_a_latched_subscription_gets_what_a_node_sent_before(network, client):
    publisher = declare_advanced_publisher(
        client.session,
        RosSettings().data_key("/map_name", String),
        cache=zenoh.ext.CacheConfig(1),
        publisher_detection=True,
        sample_miss_detection=zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=0.5),
    )
    publisher.put(String(data="office").to_cdr(), attachment=Attachment(1, 1, WHO).to_bytes())
    client.settle()
    got = queue.SimpleQueue()
    network.open_subscription(Topic("/map_name", String, LATCHED), got.put)
    assert got.get(timeout=TIMEOUT) == String(data="office")


def test_a_closed_network_sends_nothing_and_closes_twice(network, client):
    matched = Matched()
    publisher = network.open_publisher(HEARTBEAT, matched)
    latched = network.open_publisher(Topic("/robot_description", String, LATCHED))
    client.listen(HEARTBEAT_KEY)
    matched.wait()
    network.close()
    network.close()
    assert (publisher.matched, latched.matched) == (False, False)
    publisher.publish(String(data="too late"))
