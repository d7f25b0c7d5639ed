"""The ROS graph that ROS 2 nodes see, and the warnings when type definitions differ."""

import queue
import threading

import pytest
import zenoh
from waits import until
from wire.ros_peer import (
    ANY_PORT,
    HEARTBEAT,
    HEARTBEAT_KEY,
    STRING_HASH,
    TIMEOUT,
    TRIGGER_KEY,
    WHO,
    WRENCH_HASH,
    WRENCH_KEY,
    WRENCH_TYPE,
    Matched,
    request,
    tokens,
)
from zenoh.handlers import Callback

from mjplug.contracts.transport import CLOCK, DEFAULT, LATEST, ServiceName, Topic
from mjplug.wire.network import open_network
from mjplug.wire.rmw_zenoh.attachment import Attachment
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.rmw_zenoh.mismatches import MAX_REPORTED_HASHES
from mjplug.wire.session import SessionSettings
from mjplug_schemas.geometry_msgs import Twist
from mjplug_schemas.mujoco_ros2_control_msgs import ApplyExternalWrench
from mjplug_schemas.rosgraph_msgs import Clock
from mjplug_schemas.std_msgs import String
from mjplug_schemas.std_srvs import Trigger


@pytest.fixture
def network(new_ros_network):
    return new_ros_network()


def test_the_graph_shows_a_node_with_its_endpoints(network, client):
    network.open_publisher(HEARTBEAT)
    network.open_service(ServiceName("/external_wrench/apply_wrench", ApplyExternalWrench), print)
    network.open_subscription(Topic("/cmd_vel", Twist, LATEST), print)
    client.settle()
    zid = str(network.session.zenoh.zid())
    twist_hash = "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a"
    graph = f"@ros2_lv/0/{zid}/0"
    assert tokens(client) == [
        f"{graph}/0/NN/%/%/mjplug",
        f"{graph}/2/MP/%/%/mjplug/%mujoco_heartbeat/std_msgs::msg::dds_::String_/{STRING_HASH}/::,10:,:,:,,",
        f"{graph}/3/SS/%/%/mjplug/%external_wrench%apply_wrench/{WRENCH_TYPE}/{WRENCH_HASH}/::,10:,:,:,,",
        f"{graph}/4/MS/%/%/mjplug/%cmd_vel/geometry_msgs::msg::dds_::Twist_/{twist_hash}/::,1:,:,:,,",
    ]


def test_domain_namespace_and_distribution_are_in_the_tokens(new_ros_network, client_of):
    network = new_ros_network("/robot1/arm/sim", domain_id=7, distro="humble")
    network.open_publisher(Topic("/clock", Clock, CLOCK))
    client = client_of(network.session.endpoint)
    zid = str(network.session.zenoh.zid())
    told = tokens(client)
    assert told == [
        f"@ros2_lv/7/{zid}/0/0/NN/%/%robot1%arm/sim",
        f"@ros2_lv/7/{zid}/0/1/MP/%/%robot1%arm/sim/%clock/rosgraph_msgs::msg::dds_::Clock_/TypeHashNotSupported"
        "/2::,1:,:,:,,",
    ]


def test_tokens_come_and_go_with_the_server_the_node_first_and_last(opened, client_of):
    router = opened(open_network(SessionSettings(listen=ANY_PORT), "/router"))
    watcher = client_of(router.session.endpoint)
    seen = queue.SimpleQueue()
    kept = watcher.session.liveliness().declare_subscriber(
        "@ros2_lv/**",
        Callback(lambda sample: seen.put((sample.kind, str(sample.key_expr).split("/")[5])), indirect=False),
    )
    settings = SessionSettings(mode="peer", listen=ANY_PORT, connect=(router.session.endpoint,))
    network = opened(open_network(settings, "/mjplug", ros2=RosSettings()))
    network.open_publisher(HEARTBEAT)
    network.open_service(ServiceName("/trigger", Trigger), print)
    # The first service is one that every node has.
    declared = ["NN", "SS", "MP", "SS"]
    seen_put = [seen.get(timeout=TIMEOUT) for _ in declared]
    assert all(kind == zenoh.SampleKind.PUT for kind, _ in seen_put)
    assert sorted(what for _, what in seen_put) == sorted(declared)
    network.close()
    gone = [seen.get(timeout=TIMEOUT) for _ in declared]
    assert gone == [(zenoh.SampleKind.DELETE, what) for what in reversed(declared)]
    kept.undeclare()


@pytest.mark.slow
def test_everything_comes_back_after_the_router_was_gone(opened, client_of):
    router = opened(open_network(SessionSettings(listen=ANY_PORT), "/router"))
    endpoint = router.session.endpoint
    network = opened(open_network(SessionSettings(mode="client", connect=(endpoint,)), "/mjplug", ros2=RosSettings()))
    matched = Matched()
    publisher = network.open_publisher(HEARTBEAT, matched)
    network.open_service(ServiceName("/trigger", Trigger), lambda call: call.respond(Trigger.Response(success=True)))
    before = tokens(client_of(endpoint))
    router.close()
    opened(open_network(SessionSettings(listen=(endpoint,)), "/router"))
    client = client_of(endpoint)
    until(lambda: tokens(client) == before)
    assert len(before) == 3
    samples = client.listen(HEARTBEAT_KEY)
    matched.wait()
    publisher.publish(String(data="still alive"))
    assert bytes(samples.get(timeout=TIMEOUT).payload) == String(data="still alive").to_cdr()
    reply = request(client, TRIGGER_KEY, b"\0\1\0\0\0", Attachment(1, 1, WHO).to_bytes())
    assert Trigger.Response.from_cdr(bytes(reply.ok.payload)).success is True


def test_the_listing_names_the_keys(network, client):
    network.open_publisher(HEARTBEAT)
    network.open_service(ServiceName("/external_wrench/apply_wrench", ApplyExternalWrench), print)
    listing = client.call("mjplug/interfaces").json
    assert [topic["ros2_key"] for topic in listing["topics"]] == [HEARTBEAT_KEY]
    assert [service["ros2_key"] for service in listing["services"]] == [WRENCH_KEY]


def test_another_definition_of_a_type_is_reported_once(network, client, caplog):
    told = queue.SimpleQueue()
    client_token = client.session.liveliness().declare_token
    zid = str(client.session.zid())
    other, third = "RIHS01_" + "0" * 64, "RIHS01_" + "1" * 64
    caplog.handler.addFilter(lambda record: told.put(record) or True)
    theirs = f"@ros2_lv/0/{zid}/0/1/MS/%/%robot1/listener/%mujoco_heartbeat/std_msgs::msg::dds_::String_"
    kept = [client_token(f"{theirs}/{STRING_HASH}/::,10:,:,:,,"), client_token(f"{theirs}/{other}/::,10:,:,:,,")]
    client.settle()
    network.open_publisher(HEARTBEAT)
    told.get(timeout=TIMEOUT)
    kept.append(client_token(f"{theirs}/{other}/::,1:,:,:,,"))
    kept.append(client_token(f"{theirs}/{third}/::,1:,:,:,,"))
    told.get(timeout=TIMEOUT)
    line, about_third = [line for line in caplog.messages if "type hash" in line]
    assert f"type hash {third}; the hash of mjplug is {STRING_HASH}" in about_third
    assert line.startswith(
        "/mujoco_heartbeat: node /robot1/listener has a subscription of type std_msgs/msg/String "
        f"with type hash {other}; the hash of mjplug is {STRING_HASH}. Messages may not arrive"
    )
    assert "`ros2 interface show std_msgs/msg/String`" in line
    assert "mjplug/interfaces?schema=true" in line


def test_a_flood_of_type_hashes_neither_fills_the_log_nor_memory(network, client, caplog):
    zid = str(client.session.zid())
    theirs = f"@ros2_lv/0/{zid}/0/1/MS/%/%/listener/%mujoco_heartbeat/std_msgs::msg::dds_::String_"
    count = 300
    declare = client.session.liveliness().declare_token
    kept = [declare(f"{theirs}/RIHS01_{number:064x}/::,10:,:,:,,") for number in range(count)]
    client.settle()
    network.open_publisher(HEARTBEAT)
    # In order behind the tokens on the same link.
    client.settle()
    lines = [line for line in caplog.messages if "type hash" in line]
    told = [line for line in lines if line.startswith("/mujoco_heartbeat: node /listener")]
    more = [line.partition(": the latest")[0] for line in lines if line not in told]
    assert len(told) == MAX_REPORTED_HASHES
    what = "/mujoco_heartbeat: nodes announce more type hashes of std_msgs/msg/String"
    assert more == [f"{what} ({number} so far)" for number in (1, 10, 100)]
    assert len(kept) == count


@pytest.mark.parametrize(
    ("distro", "theirs", "way_out"),
    [
        ("jazzy", "TypeHashNotSupported", "set ros2.distro to humble"),
        ("humble", STRING_HASH, "set ros2.distro to its distribution"),
    ],
)
def test_the_wrong_distribution_is_named_as_the_cause(new_ros_network, client_of, caplog, distro, theirs, way_out):
    network = new_ros_network(distro=distro)
    client = client_of(network.session.endpoint)
    told = threading.Event()
    caplog.handler.addFilter(lambda record: told.set() or True)
    network.open_subscription(Topic("/chatter", String, DEFAULT), print)
    token = f"@ros2_lv/0/{client.session.zid()}/0/1/MP/%/%/talker/%chatter/std_msgs::msg::dds_::String_/{theirs}"
    kept = client.session.liveliness().declare_token(f"{token}/::,10:,:,:,,")
    assert told.wait(TIMEOUT)
    assert way_out in caplog.messages[0]
    kept.undeclare()
