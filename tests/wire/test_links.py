"""What the links of a session cost, and how they end."""

import gc
import json
import logging
import os
import queue
import socket
import struct
import threading
from contextlib import ExitStack

import pytest
import zenoh
from waits import TIMEOUT
from zenoh.handlers import Callback

from mjplug.client import connect
from mjplug.contracts.transport import DEFAULT, Topic
from mjplug.wire import exposure, linger, zenoh_file
from mjplug.wire.endpoints import on_free_port
from mjplug.wire.session import SessionSettings, join, open_router, open_session
from mjplug_schemas.std_msgs import String


def test_a_subscription_returns_when_its_publishers_know_of_it_however_late_zenoh_reports_it(network):
    publisher = network.open_publisher(Topic("/x", String, DEFAULT))
    plug = network.session.zenoh.declare_publisher("plug")
    blocked, release = threading.Event(), threading.Event()

    def block(status):
        if status.matching:
            blocked.set()
            release.wait(TIMEOUT)

    # Zenoh reports subscribers to publishers on one thread, which this stops.
    plug.declare_matching_listener(Callback(block, indirect=False))
    try:
        with connect(network.session.endpoint) as client:
            client.session.declare_subscriber("plug", lambda sample: None)
            assert blocked.wait(TIMEOUT)
            assert not publisher.matched
            messages = client.subscribe("/x")
            assert publisher.matched
            publisher.publish(String(data="first"))
            assert messages.next(TIMEOUT) == String(data="first")
            messages.close()
            release.set()
    finally:
        release.set()


def test_a_publisher_is_notified_of_its_first_subscriber_once(network):
    appeared = []
    publisher = network.open_publisher(Topic("/x", String, DEFAULT), lambda: appeared.append("once"))
    with connect(network.session.endpoint) as client:
        for _ in range(3):
            client.subscribe("/x")
        assert publisher.matched
        assert appeared == ["once"]
        client.subscribe("/x", dict)
        assert appeared == ["once", "once"]


def test_the_interfaces_say_whether_a_key_has_a_subscriber(network, client):
    network.open_publisher(Topic("/x", String, DEFAULT))
    assert client.call("mjplug/interfaces?subscribed=x").json == {"key": "x", "subscribed": False}
    client.listen("x/@json")
    assert client.call("mjplug/interfaces?subscribed=x").json == {"key": "x", "subscribed": False}
    assert client.call("mjplug/interfaces?subscribed=x/@json").json == {"key": "x/@json", "subscribed": True}
    assert client.call("mjplug/interfaces?subscribed=nowhere").json == {"key": "nowhere", "subscribed": False}


def lingering():
    """The local ports of this process's connections that block when they are closed."""
    found = {}
    for name in os.listdir("/proc/self/fd"):
        try:
            if not os.readlink(f"/proc/self/fd/{name}").startswith("socket:"):
                continue
            with socket.socket(fileno=os.dup(int(name))) as one:
                if one.family not in (socket.AF_INET, socket.AF_INET6):
                    continue
                one.getpeername()
                on, seconds = struct.unpack("ii", one.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, 8))
                found[one.getsockname()[1], one.getpeername()[1]] = seconds if on else 0
        except OSError:
            continue
    return found


linux_only = pytest.mark.skipif(not os.path.isdir("/proc/self/fd"), reason="only on Linux does a close wait")


@linux_only
def test_no_link_of_a_server_or_its_worker_waits_when_it_is_closed(network, client_of, opened):
    port = int(network.session.endpoint.rpartition(":")[2])
    worker = opened(join(SessionSettings(), (network.session.endpoint,)))
    strangers = [client_of(network.session.endpoint) for _ in range(3)]
    for stranger in strangers:
        stranger.settle()
    (link,) = worker.info.links()
    own = int(str(link.src).rpartition(":")[2])
    found = lingering()
    at_server = {pair: seconds for pair, seconds in found.items() if pair[0] == port}
    assert len(at_server) == 4
    assert set(at_server.values()) == {0}
    assert found[own, port] == 0
    # A stranger in this process keeps what Zenoh sets, so that this test would see it at the server too.
    (far,) = strangers[0].session.info.links()
    assert found[int(str(far.src).rpartition(":")[2]), port] > 0


@linux_only
def test_only_the_socket_of_the_link_is_touched():
    with socket.create_server(("127.0.0.1", 0)) as listening:
        near = socket.create_connection(listening.getsockname())
        far, _ = listening.accept()
        with near, far:
            for one in (near, far):
                one.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 10))
            ports = near.getsockname()[1], near.getpeername()[1]
            linger._switch_off(ports)
            found = lingering()
            assert (found[ports], found[ports[::-1]]) == (0, 10)
            gc.collect()
            near.sendall(b"still open")
            assert far.recv(20) == b"still open"


@linux_only
def test_links_from_the_same_port_of_two_machines_are_distinguished():
    with ExitStack() as stack:
        listening = stack.enter_context(socket.create_server(("", 0)))
        port = listening.getsockname()[1]
        low_number, *clients = (stack.enter_context(socket.socket()) for _ in range(3))
        servers = []
        for client, address in zip(clients, ("127.0.0.2", "127.0.0.3"), strict=True):
            client.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            source = clients[0].getsockname()[1]
            client.bind((address, source))
            client.connect(("127.0.0.1", port))
            servers.append(stack.enter_context(listening.accept()[0]))
            servers[-1].setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 10))
            linger._switch_off((port, client.getsockname()[1]))
            # The next socket gets its file number, which is below that of the first client.
            low_number.close()
        assert servers[1].fileno() < servers[0].fileno()
        assert [struct.unpack("ii", one.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, 8))[0] for one in servers] == [
            0,
            0,
        ]


@pytest.mark.parametrize(
    ("text", "enabled"),
    [
        ("{}", False),
        ('{ mode: "router" } // shared_memory: { enabled: true }', False),
        ('{ /* transport: { shared_memory: { enabled: true } } */ mode: "router" }', False),
        ('{ connect: { endpoints: ["tcp/127.0.0.1:7447"] }, transport: { shared_memory: { enabled: true } } }', True),
        ('{ "transport": { "shared_memory": { "enabled": true } } }', True),
        ("{ transport: { shared_memory: { enabled: false } } }", False),
    ],
)
def test_shared_memory_is_off_unless_the_file_says_otherwise(tmp_path, text, enabled):
    file = tmp_path / "zenoh.json5"
    file.write_text(text)
    assert json.loads(zenoh_file.read_zenoh_file(file).get_json(zenoh_file.SHARED_MEMORY)) is enabled
    assert json.loads(zenoh.Config.from_file(file).get_json(zenoh_file.SHARED_MEMORY)) is ("false" not in text)
    assert json.loads(zenoh_file.read_zenoh_file(None).get_json(zenoh_file.SHARED_MEMORY)) is False


def test_shared_memory_in_a_yaml_file_counts_too(tmp_path):
    file = tmp_path / "zenoh.yaml"
    file.write_text("mode: router\n# shared_memory: off by default\n")
    assert json.loads(zenoh_file.read_zenoh_file(file).get_json(zenoh_file.SHARED_MEMORY)) is False
    file.write_text("transport:\n  shared_memory:\n    enabled: true\n")
    assert json.loads(zenoh_file.read_zenoh_file(file).get_json(zenoh_file.SHARED_MEMORY)) is True


def config(**settings):
    made = zenoh.Config()
    for key, value in settings.items():
        made.insert_json5(key.replace("__", "/"), json.dumps(value))
    return made


PASSWORDS = {"transport__auth__usrpwd__dictionary_file": "users.txt"}
MUTUAL = {"transport__link__tls__enable_mtls": True}


@pytest.mark.parametrize(
    ("endpoint", "settings", "sentence"),
    [
        ("tcp/127.0.0.1:7447", {}, None),
        ("tcp/127.8.8.8:7447", {}, None),
        ("tcp/[::1]:7447", {}, None),
        ("tcp/localhost:7447", {}, None),
        ("udp/127.0.0.1:7447", {}, None),
        ("unixsock-stream//tmp/zenoh.sock", {}, None),
        ("tcp/0.0.0.0:7447", {}, "accepts all clients without authentication or encryption"),
        ("tcp/[::]:7447", {}, "accepts all clients without authentication or encryption"),
        ("udp/0.0.0.0:7447", {}, "accepts all clients without authentication or encryption"),
        ("ws/192.0.2.1:7447", {}, "accepts all clients without authentication or encryption"),
        ("tcp/no-such-host.invalid:7447", {}, "accepts all clients without authentication or encryption"),
        ("tcp/0.0.0.0:7447#iface=eth0", {}, "accepts all clients without authentication or encryption"),
        ("tls/0.0.0.0:7447", {}, "is encrypted, but accepts clients without a certificate"),
        ("quic/192.0.2.1:7447", {}, "is encrypted, but accepts clients without a certificate"),
        ("tcp/0.0.0.0:7447", MUTUAL, "accepts all clients without authentication or encryption"),
        ("tls/0.0.0.0:7447", MUTUAL, None),
        ("tls/0.0.0.0:7447#enable_mtls=true", {}, None),
        ("tcp/0.0.0.0:7447", PASSWORDS, None),
        ("tls/0.0.0.0:7447", PASSWORDS, None),
    ],
)
def test_an_endpoint_beyond_loopback_without_authentication_is_reported(endpoint, settings, sentence):
    found = exposure.warnings(("tcp/127.0.0.1:1", endpoint), config(**settings))
    if sentence is None:
        assert found == []
    else:
        (line,) = found
        assert line.startswith(f"{endpoint} {sentence}")
        assert "or listen on 127.0.0.1" in line


def test_a_server_that_everybody_can_reach_reports_it_at_its_start(new_network, caplog):
    with caplog.at_level(logging.WARNING, "mjplug.wire"):
        new_network("/guarded")
        assert caplog.messages == []
        endpoint = new_network("/open", listen=("tcp/0.0.0.0:0",)).session.endpoint
    assert [line.split(":")[0] for line in caplog.messages] == ["tcp/0.0.0.0"]
    assert caplog.messages[0].startswith(f"{endpoint} accepts all clients")


def test_servers_that_meet_on_one_port_have_one_link_each(network, new_network):
    joined = [new_network(f"/robot{i}/mjplug", listen=network.session.listening) for i in range(6)]
    assert {one.session.role for one in joined} == {"client"}
    assert [len(one.session.zenoh.info.links()) for one in joined] == [1] * 6
    assert len(network.session.zenoh.info.links()) == 6


def test_with_connect_alone_a_server_is_a_client_of_that_router(network, new_network, client):
    joined = new_network("/robot2", listen=None, connect=network.session.listening)
    assert (joined.session.role, joined.session.listening) == ("client", ())
    assert joined.session.endpoint == network.session.endpoint
    assert client.call("robot2/interfaces").json["name"] == "/robot2"


def test_with_connect_and_listen_a_server_is_a_router_beside_that_router(network, new_network, client):
    joined = new_network("/robot2", connect=network.session.listening)
    assert joined.session.role == "router"
    assert client.call("robot2/interfaces").json["name"] == "/robot2"


def test_a_server_waits_for_the_router_that_it_is_configured_to_connect_to(opened, new_network, caplog):
    endpoint = on_free_port("tcp/127.0.0.1:0")
    found = queue.SimpleQueue()
    with caplog.at_level(logging.WARNING, "mjplug.wire"):
        thread = threading.Thread(
            target=lambda: found.put(open_session(SessionSettings(connect=(endpoint,)), "/early")), daemon=True
        )
        thread.start()
        with pytest.raises(queue.Empty):
            found.get(timeout=1.5)
        opened(open_router(SessionSettings(listen=(endpoint,))))
        early = opened(found.get(timeout=2 * TIMEOUT))
    assert early.role == "client"
    assert [line for line in caplog.messages if line.endswith("; waiting for it")]
    assert len(caplog.messages) == 1
