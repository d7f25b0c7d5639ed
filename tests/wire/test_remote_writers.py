"""A publisher handed to another session: here in the same process, which is all the same to Zenoh."""

import pickle
import queue
import threading
import time

import pytest
import zenoh
from waits import TIMEOUT
from wire.conftest import ANY_PORT, client_config
from wire.narrow_link import NarrowLink
from zenoh.ext import HistoryConfig, declare_advanced_subscriber
from zenoh.handlers import Callback

from mjplug.contracts.transport import DEFAULT, LATCHED, Topic
from mjplug.errors import WireError
from mjplug.wire.network import open_network
from mjplug.wire.rmw_zenoh.attachment import Attachment
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.rmw_zenoh.tokens import gid
from mjplug.wire.session import SessionSettings, join
from mjplug_schemas.std_msgs import String

SETTINGS = SessionSettings(listen=ANY_PORT)
ROS_KEY = RosSettings().data_key("/told", String)


@pytest.fixture
def network(opened):
    return opened(open_network(SETTINGS, "/mjplug", ros2=RosSettings()))


@pytest.fixture
def tenant(network, opened):
    return opened(join(SETTINGS, network.session.endpoints))


def handed_over(network, tenant, qos, on_matched=lambda: None):
    """The server's publisher, and the one of whoever got its lease."""
    landlord = network.open_publisher(Topic("/told", String, qos))
    return landlord, pickle.loads(pickle.dumps(landlord.remote_spec())).open(tenant, on_matched)


def gid_of_the_token(client):
    (token,) = client.session.liveliness().get("@ros2_lv/0/*/*/*/MP/*/*/*/%told/**", timeout=TIMEOUT)
    return gid(str(token.ok.key_expr))


@pytest.mark.parametrize("key", ["told", "told/@json", ROS_KEY])
def test_what_a_tenant_publishes_is_the_servers(network, tenant, client, key):
    matched = threading.Event()
    landlord, publisher = handed_over(network, tenant, DEFAULT, matched.set)
    assert not publisher.matched
    samples = client.listen(key)
    assert matched.wait(TIMEOUT)
    publisher.publish(String(data="hello"))
    sample = samples.get(timeout=TIMEOUT)
    # Heard as the server's own would be, but for the session that it came from.
    client.settle()
    landlord.publish(String(data="hello"))
    own = samples.get(timeout=TIMEOUT)
    assert (bytes(sample.payload), str(sample.encoding)) == (bytes(own.payload), str(own.encoding))
    if key == ROS_KEY:
        assert Attachment.from_bytes(bytes(sample.attachment)).gid == gid_of_the_token(client)


def test_a_tenant_that_leaves_changes_nothing_for_ros(network, tenant, client):
    handed_over(network, tenant, DEFAULT)
    before = gid_of_the_token(client)
    tenant.close()
    assert gid_of_the_token(client) == before


@pytest.mark.parametrize("key", ["told", "told/@json", ROS_KEY])
def test_a_latched_message_of_a_tenant_waits_for_those_who_come_later(network, tenant, client, key):
    _, publisher = handed_over(network, tenant, LATCHED)
    assert publisher.matched
    publisher.publish(String(data="hello"))
    samples = queue.SimpleQueue()
    kept = declare_advanced_subscriber(
        client.session, key, Callback(samples.put, indirect=False), history=HistoryConfig(detect_late_publishers=True)
    )
    sample = samples.get(timeout=TIMEOUT)
    assert b"hello" in bytes(sample.payload)
    if key == ROS_KEY:
        assert Attachment.from_bytes(bytes(sample.attachment)).gid == gid_of_the_token(client)
    kept.undeclare()


@pytest.fixture
def narrow_client(network, opened):
    """A client with its own network address, with a link of 4 MB/s."""
    link = opened(NarrowLink(int(network.session.endpoint.rpartition(":")[2]), 4e6))
    config = client_config(link.endpoint)
    config.insert_json5("transport/shared_memory/enabled", "false")
    return opened(zenoh.open(config))


@pytest.mark.parametrize("key", ["told", ROS_KEY])
def test_a_link_that_is_full_of_what_a_tenant_publishes_loses_nothing_of_the_servers(
    network, tenant, narrow_client, key
):
    matched, small_matched, large, small = threading.Event(), threading.Event(), [], queue.SimpleQueue()
    _, publisher = handed_over(network, tenant, DEFAULT, matched.set)
    own = network.open_publisher(Topic("/small", String, DEFAULT), small_matched.set)
    subscribers = [
        narrow_client.declare_subscriber(key, Callback(large.append, indirect=False)),
        narrow_client.declare_subscriber("small", Callback(small.put, indirect=False)),
    ]
    assert matched.wait(TIMEOUT)
    assert small_matched.wait(TIMEOUT)
    picture = String(data="x" * 1_000_000)
    for number in range(150):
        if number % 5 == 0:
            publisher.publish(picture)
        own.publish(String(data=str(number)))
        time.sleep(0.01)
    heard = [String.from_cdr(small.get(timeout=TIMEOUT).payload.to_bytes()).data for _ in range(150)]
    assert heard == [str(number) for number in range(150)]
    # The link was full.
    assert len(large) < 30
    for subscriber in subscribers:
        subscriber.undeclare()


def test_joining_without_a_server_fails(opened):
    network = open_network(SETTINGS, "/gone")
    endpoints = network.session.endpoints
    network.close()
    with pytest.raises(WireError, match="cannot connect to tcp"):
        opened(join(SETTINGS, endpoints))


ACCESS_CONTROL = """{
  transport: {auth: {usrpwd: {user: "operator", password: "run", dictionary_file: "USERS"}}},
  access_control: {
    enabled: true,
    default_permission: "deny",
    rules: [
      {id: "to tell", permission: "allow", messages: ["put", "declare_subscriber"], key_exprs: ["**"]},
    ],
    subjects: [{id: "operators", usernames: ["operator"]}, {id: "guests", usernames: ["guest"]}],
    policies: [{rules: ["to tell"], subjects: ["operators", "guests"]}],
  },
}"""


def test_the_rules_of_the_servers_file_do_not_silence_a_tenant_that_they_allow_to_tell(opened, tmp_path):
    file = tmp_path / "server.json5"
    users = tmp_path / "users.txt"
    users.write_text("operator:run\nguest:look\n")
    file.write_text(ACCESS_CONTROL.replace("USERS", str(users)))
    settings = SessionSettings(listen=ANY_PORT, config=file)
    network = opened(open_network(settings, "/mjplug"))
    matched = threading.Event()
    _, publisher = handed_over(network, opened(join(settings, network.session.endpoints)), DEFAULT, matched.set)
    samples = queue.SimpleQueue()
    guest = client_config(network.session.endpoint)
    guest.insert_json5("transport/auth/usrpwd", '{user: "guest", password: "look"}')
    with zenoh.open(guest) as session:
        subscriber = session.declare_subscriber("told", Callback(samples.put, indirect=False))
        assert matched.wait(TIMEOUT)
        publisher.publish(String(data="hello"))
        assert String.from_cdr(bytes(samples.get(timeout=TIMEOUT).payload)).data == "hello"
        subscriber.undeclare()
