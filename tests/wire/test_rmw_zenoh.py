"""Topics and services on the keys of rmw_zenoh: a server on 127.0.0.1, and bare Zenoh peers that check bytes."""

import queue
import threading
import time

import pytest
import zenoh
from zenoh.ext import HistoryConfig, RecoveryConfig, declare_advanced_publisher, declare_advanced_subscriber
from zenoh.handlers import Callback

from mjplug.transport import CLOCK, DEFAULT, LATCHED, LATEST, ServiceName, Topic
from mjplug.wire.network import open_network
from mjplug.wire.rmw_zenoh.attachment import Attachment
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.rmw_zenoh.tokens import gid
from mjplug.wire.session import SessionSettings
from mjplug_schemas.builtin_interfaces import Duration
from mjplug_schemas.geometry_msgs import Twist, Vector3, Wrench, WrenchStamped
from mjplug_schemas.mujoco_ros2_control_msgs import ApplyExternalWrench, ExternalWrench, ExternalWrenchArray
from mjplug_schemas.rosgraph_msgs import Clock
from mjplug_schemas.std_msgs import Header, String
from mjplug_schemas.std_srvs import Empty, SetBool, Trigger

PATIENCE = 5.0
ANY_PORT = ("tcp/127.0.0.1:0",)

STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
WRENCH_HASH = "RIHS01_3ced9bbef0a495b94e0ebe367964b04cd15ff52376462634600793fb05026982"
HEARTBEAT_KEY = f"0/mujoco_heartbeat/std_msgs::msg::dds_::String_/{STRING_HASH}"
WRENCH_TYPE = "mujoco_ros2_control_msgs::srv::dds_::ApplyExternalWrench_"
WRENCH_KEY = f"0/external_wrench/apply_wrench/{WRENCH_TYPE}/{WRENCH_HASH}"
TRIGGER_KEY = RosSettings().data_key("/trigger", Trigger)

HEARTBEAT = Topic("/mujoco_heartbeat", String, DEFAULT)
WHO = bytes(range(100, 116))


@pytest.fixture
def new_ros_network(opened):
    def open_one(name="/mjplug", domain_id=0, distro="jazzy", **settings):
        wanted = SessionSettings(listen=ANY_PORT, **settings)
        return opened(open_network(wanted, name, ros2=RosSettings(domain_id, distro)))

    return open_one


@pytest.fixture
def network(new_ros_network):
    return new_ros_network()


class Matched:
    """An event for each first listener."""

    def __init__(self):
        self._events = queue.SimpleQueue()

    def __call__(self):
        self._events.put(None)

    def wait(self):
        self._events.get(timeout=PATIENCE)


def tokens(client, key="@ros2_lv/**"):
    """All tokens but those of the services that every node has."""
    replies = client.session.liveliness().get(key, timeout=PATIENCE)
    return sorted(token for token in (str(reply.ok.key_expr) for reply in replies) if "_interfaces::" not in token)


def request(client, key, payload, attachment, target=zenoh.QueryTarget.ALL_COMPLETE):
    """What a client of rmw_zenoh sends; the one reply."""
    replies = client.session.get(
        key,
        payload=payload,
        attachment=attachment,
        target=target,
        consolidation=zenoh.ConsolidationMode.NONE,
        timeout=PATIENCE,
    )
    (reply,) = list(replies)
    return reply


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
        f"{graph}/10/MS/%/%/mjplug/%cmd_vel/geometry_msgs::msg::dds_::Twist_/{twist_hash}/::,1:,:,:,,",
        f"{graph}/8/MP/%/%/mjplug/%mujoco_heartbeat/std_msgs::msg::dds_::String_/{STRING_HASH}/::,10:,:,:,,",
        f"{graph}/9/SS/%/%/mjplug/%external_wrench%apply_wrench/{WRENCH_TYPE}/{WRENCH_HASH}/::,10:,:,:,,",
    ]


def test_domain_namespace_and_distribution_are_in_the_tokens(new_ros_network, client_of):
    network = new_ros_network("/robot1/arm/sim", domain_id=7, distro="humble")
    network.open_publisher(Topic("/clock", Clock, CLOCK))
    client = client_of(network.session.endpoint)
    zid = str(network.session.zenoh.zid())
    told = tokens(client)
    assert told == [
        f"@ros2_lv/7/{zid}/0/0/NN/%/%robot1%arm/sim",
        f"@ros2_lv/7/{zid}/0/7/MP/%/%robot1%arm/sim/%clock/rosgraph_msgs::msg::dds_::Clock_/TypeHashNotSupported"
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
    # Seven services are those of every node.
    declared = ["NN", *["SS"] * 7, "MP", "SS"]
    seen_put = [seen.get(timeout=PATIENCE) for _ in declared]
    assert all(kind == zenoh.SampleKind.PUT for kind, _ in seen_put)
    assert sorted(what for _, what in seen_put) == sorted(declared)
    network.close()
    gone = [seen.get(timeout=PATIENCE) for _ in declared]
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
    until(lambda: tokens(client) == before, within=15.0)
    assert len(before) == 3
    samples = client.listen(HEARTBEAT_KEY)
    matched.wait()
    publisher.publish(String(data="still alive"))
    assert bytes(samples.get(timeout=PATIENCE).payload) == String(data="still alive").to_cdr()
    reply = request(client, TRIGGER_KEY, b"\0\1\0\0\0", Attachment(1, 1, WHO).to_bytes())
    assert Trigger.Response.from_cdr(bytes(reply.ok.payload)).success is True


def test_a_message_has_the_bytes_of_the_worked_example(network, client):
    matched = Matched()
    publisher = network.open_publisher(HEARTBEAT, matched)
    assert not publisher.matched
    samples = client.listen(HEARTBEAT_KEY)
    matched.wait()
    before = time.time_ns()
    publisher.publish(String(data="alive"))
    sample = samples.get(timeout=PATIENCE)
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
            sample = samples.get(timeout=PATIENCE)
            numbers.append(Attachment.from_bytes(bytes(sample.attachment)).sequence_number)
        subscriber.undeclare()
        until(lambda: not publisher.matched)
    assert numbers == [1, 2, 3, 4]


def until(condition, within=PATIENCE):
    """Waits for something that nobody tells us about."""
    deadline = time.monotonic() + within
    tick = threading.Event()
    while not condition():
        assert time.monotonic() < deadline
        tick.wait(0.002)


def test_plain_clients_and_nodes_get_the_same_payload(network, client):
    matched = Matched()
    publisher = network.open_publisher(HEARTBEAT, matched)
    plain, ros = client.listen("mujoco_heartbeat"), client.listen(HEARTBEAT_KEY)
    matched.wait()
    matched.wait()
    publisher.publish(String(data="both"))
    first, second = plain.get(timeout=PATIENCE), ros.get(timeout=PATIENCE)
    assert bytes(first.payload) == bytes(second.payload) == String(data="both").to_cdr()
    assert first.attachment is None
    assert (str(first.encoding), str(second.encoding)) == ("application/cdr;std_msgs/msg/String", "zenoh/bytes")


@pytest.mark.parametrize("reliability", ["reliable", "best_effort"])
def test_a_late_node_gets_the_last_latched_message_as_it_was_sent(network, client, reliability):
    topic = Topic("/robot_description", String, type(LATCHED)(1, reliability, "transient_local"))
    publisher = network.open_publisher(topic)
    for text in ("old", "new"):
        publisher.publish(String(data=text))
    client.settle()
    samples = queue.SimpleQueue()
    start = time.monotonic()
    subscriber = declare_advanced_subscriber(
        client.session,
        RosSettings().data_key("/robot_description", String),
        samples.put,
        history=HistoryConfig(detect_late_publishers=True, max_samples=1),
        recovery=RecoveryConfig(periodic_queries=None, heartbeat=True) if reliability == "reliable" else None,
        subscriber_detection=True,
    )
    sample = samples.get(timeout=PATIENCE)
    assert time.monotonic() - start < 0.5
    assert String.from_cdr(bytes(sample.payload)).data == "new"
    attachment = Attachment.from_bytes(bytes(sample.attachment))
    (token,) = tokens(client, "@ros2_lv/*/*/*/*/MP/**")
    assert (attachment.sequence_number, attachment.gid) == (2, gid(token))
    publisher.publish(String(data="live"))
    live = samples.get(timeout=PATIENCE)
    assert String.from_cdr(bytes(live.payload)).data == "live"
    assert Attachment.from_bytes(bytes(live.attachment)).sequence_number == 3
    subscriber.undeclare()


@pytest.mark.parametrize("type_hash", [RosSettings().type_hash(Twist), "TypeHashNotSupported", "RIHS01_" + "0" * 64])
def test_messages_of_nodes_are_read_whatever_their_hash(network, client, type_hash):
    got = queue.SimpleQueue()
    network.open_subscription(Topic("/cmd_vel", Twist, LATEST), got.put)
    twist = Twist(linear=Vector3(x=0.5))
    publisher = client.publisher(f"0/cmd_vel/geometry_msgs::msg::dds_::Twist_/{type_hash}")
    publisher.put(b"\0\1\0\0not a twist", attachment=Attachment(1, 1, WHO).to_bytes())
    publisher.put(twist.to_cdr(), encoding="image/png", attachment=Attachment(2, 1, WHO).to_bytes())
    assert got.get(timeout=PATIENCE) == twist


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
    assert got.get(timeout=PATIENCE) == String(data="office")


def wrench():
    return ExternalWrench(
        wrench=WrenchStamped(header=Header(frame_id="pelvis"), wrench=Wrench(force=Vector3(x=10.0))),
        duration=Duration(sec=1),
        ramp_down_duration=Duration(nanosec=500_000_000),
    )


WRENCH_REQUEST = bytes.fromhex(
    "00010000 01000000"
    + "00" * 8
    + "01000000 00 000000"
    + "00" * 8
    + "07000000 70656c76697300 00"
    + "0000000000002440"
    + "00" * 40
    + "00" * 24
    + "0100000000000000 00000000 0065cd1d"
)


def test_a_deferred_response_has_the_bytes_of_the_worked_example(network, client):
    calls = queue.SimpleQueue()
    network.open_service(ServiceName("/external_wrench/apply_wrench", ApplyExternalWrench), calls.put)
    client.settle()
    replies = queue.SimpleQueue()
    client.session.get(
        WRENCH_KEY,
        replies.put,
        target=zenoh.QueryTarget.ALL_COMPLETE,
        consolidation=zenoh.ConsolidationMode.NONE,
        payload=WRENCH_REQUEST,
        attachment=Attachment(5, 1234, WHO).to_bytes(),
        timeout=PATIENCE,
    )
    call = calls.get(timeout=PATIENCE)
    assert len(WRENCH_REQUEST) == 132
    assert call.request == ApplyExternalWrench.Request(wrenches=ExternalWrenchArray(external_wrenches=(wrench(),)))
    before = time.time_ns()
    call.respond(ApplyExternalWrench.Response(success=True, message="ok"))
    sample = replies.get(timeout=PATIENCE).ok
    assert str(sample.key_expr) == WRENCH_KEY
    assert bytes(sample.payload) == bytes.fromhex("00010000 01 000000 03000000 6f6b00")
    attachment = bytes(sample.attachment)
    assert attachment[:8] == (5).to_bytes(8, "little")
    assert before <= int.from_bytes(attachment[8:16], "little") <= time.time_ns()
    assert attachment[16:] == b"\x10" + WHO


@pytest.mark.parametrize("type_hash", ["TypeHashNotSupported", "RIHS01_" + "0" * 64])
def test_requests_are_answered_whatever_their_hash(network, client, type_hash):
    network.open_service(
        ServiceName("/trigger", Trigger), lambda call: call.respond(Trigger.Response(success=True, message="done"))
    )
    client.settle()
    key = f"0/trigger/std_srvs::srv::dds_::Trigger_/{type_hash}"
    sample = request(client, key, b"\0\1\0\0\0", Attachment(1, 1, WHO).to_bytes()).ok
    assert str(sample.key_expr) == key
    assert Trigger.Response.from_cdr(bytes(sample.payload)).message == "done"


def test_a_client_that_leaves_the_hash_open_gets_ours(network, client):
    network.open_service(ServiceName("/trigger", Trigger), lambda call: call.respond(Trigger.Response(success=True)))
    client.settle()
    key = RosSettings().any_hash_key("/trigger", Trigger)
    sample = request(client, key, b"\0\1\0\0\0", Attachment(1, 1, WHO).to_bytes()).ok
    assert str(sample.key_expr) == TRIGGER_KEY


@pytest.mark.parametrize("payload", [b"\0\1\0\0\7", b"{}", b"", b"\0\1", bytes(2 << 20)])
def test_a_request_that_cannot_be_read_gets_a_response_that_says_so(network, client, payload):
    network.open_service(ServiceName("/switch", SetBool), lambda call: call.respond(SetBool.Response(success=True)))
    client.settle()
    key = RosSettings().data_key("/switch", SetBool)
    reply = request(client, key, payload, Attachment(9, 1, WHO).to_bytes())
    if payload:
        response = SetBool.Response.from_cdr(bytes(reply.ok.payload))
        assert response.success is False
        assert "SetBool_Request" in response.message or "bytes" in response.message
    else:
        # No payload at all is what a request without fields may be; it means the initial values.
        assert SetBool.Response.from_cdr(bytes(reply.ok.payload)).success is True
    assert Attachment.from_bytes(bytes(reply.ok.attachment)).sequence_number == 9


def test_a_refusal_is_a_response_even_where_the_type_has_no_words_for_it(network, client):
    network.open_service(ServiceName("/trigger", Trigger), lambda call: call.refuse("not now"))
    network.open_service(ServiceName("/empty", Empty), lambda call: call.refuse("not now"))
    client.settle()
    who = Attachment(1, 1, WHO).to_bytes()
    reply = request(client, TRIGGER_KEY, b"\0\1\0\0\0", who)
    assert Trigger.Response.from_cdr(bytes(reply.ok.payload)) == Trigger.Response(success=False, message="not now")
    reply = request(client, RosSettings().data_key("/empty", Empty), b"\0\1\0\0\0", who)
    assert bytes(reply.ok.payload) == b"\0\1\0\0\0"


def test_requests_that_wait_are_answered_before_the_server_leaves(network, client):
    calls = queue.SimpleQueue()
    network.open_service(ServiceName("/trigger", Trigger), calls.put)
    client.settle()
    replies = queue.SimpleQueue()
    client.session.get(
        TRIGGER_KEY, replies.put, payload=b"\0\1\0\0\0", attachment=Attachment(1, 1, WHO).to_bytes(), timeout=PATIENCE
    )
    calls.get(timeout=PATIENCE)
    network.close("the server is stopping")
    sample = replies.get(timeout=PATIENCE).ok
    assert Trigger.Response.from_cdr(bytes(sample.payload)).message == "the server is stopping"


@pytest.mark.parametrize(
    ("key", "attachment", "sentence"),
    [
        (TRIGGER_KEY, None, "the attachment has 0 bytes"),
        (TRIGGER_KEY, b"sequence_number", "the attachment has 15 bytes"),
        ("0/trigger/**", None, f"{TRIGGER_KEY} is a service; query exactly this key to call it"),
        ("0/trigger/*/*", None, f"{TRIGGER_KEY} is a service; query exactly this key to call it"),
    ],
)
def test_a_query_that_is_no_request_of_a_node_calls_nothing(network, client, key, attachment, sentence):
    calls = []
    network.open_service(ServiceName("/trigger", Trigger), calls.append)
    client.settle()
    reply = request(client, key, b"\0\1\0\0\0", attachment, zenoh.QueryTarget.ALL)
    assert bytes(reply.err.payload).decode().startswith(sentence)
    assert calls == []


def test_the_listing_names_the_keys(network, client):
    network.open_publisher(HEARTBEAT)
    network.open_service(ServiceName("/external_wrench/apply_wrench", ApplyExternalWrench), print)
    listing = client.call("mjplug/interfaces").json
    assert [topic["ros2_key"] for topic in listing["topics"]] == [HEARTBEAT_KEY]
    assert [service["ros2_key"] for service in listing["services"]] == [WRENCH_KEY]


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


def test_another_definition_of_a_type_is_said_aloud_once(network, client, caplog):
    told = threading.Event()
    client_token = client.session.liveliness().declare_token
    zid = str(client.session.zid())
    other = "RIHS01_" + "0" * 64
    caplog.handler.addFilter(lambda record: told.set() or True)
    theirs = f"@ros2_lv/0/{zid}/0/1/MS/%/%robot1/listener/%mujoco_heartbeat/std_msgs::msg::dds_::String_"
    kept = [client_token(f"{theirs}/{STRING_HASH}/::,10:,:,:,,"), client_token(f"{theirs}/{other}/::,10:,:,:,,")]
    client.settle()
    network.open_publisher(HEARTBEAT)
    assert told.wait(PATIENCE)
    kept.append(client_token(f"{theirs}/{other}/::,1:,:,:,,"))
    client.settle()
    (line,) = [line for line in caplog.messages if "type hash" in line]
    assert line.startswith(
        f"/mujoco_heartbeat: node /robot1/listener has a subscription for std_msgs/msg/String with type hash {other}, "
        f"mjplug has {STRING_HASH}. Messages may not get through"
    )
    assert "`ros2 interface show std_msgs/msg/String`" in line
    assert "mjplug/interfaces?schema=true" in line


@pytest.mark.parametrize(
    ("distro", "theirs", "way_out"),
    [
        ("jazzy", "TypeHashNotSupported", "set ros2.distro to humble"),
        ("humble", STRING_HASH, "set ros2.distro to what it is on"),
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
    assert told.wait(PATIENCE)
    assert way_out in caplog.messages[0]
    kept.undeclare()
