"""How a server gets onto a network. Every port is a free one of 127.0.0.1."""

import logging
import queue
import socket
import subprocess
import sys
import threading

import pytest
import zenoh
from waits import TIMEOUT

from mjplug.contracts.transport import DEFAULT, ServiceName, Topic
from mjplug.errors import WireError
from mjplug.wire import identity
from mjplug.wire import session as session_module
from mjplug.wire.endpoints import dialable, on_free_port, with_free_port
from mjplug.wire.session import SessionSettings, WireSession, open_session
from mjplug_schemas.std_msgs import String
from mjplug_schemas.std_srvs import Trigger


@pytest.fixture
def foreign():
    """The endpoint of a program that accepts connections and sends nothing."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield f"tcp/127.0.0.1:{server.getsockname()[1]}"


def test_a_server_is_a_router_on_a_free_port_and_says_which(network, client_of):
    session = network.session
    assert session.role == "router"
    assert session.listening == (session.endpoint,)
    assert int(session.endpoint.removeprefix("tcp/127.0.0.1:")) > 0
    client_of(session.endpoint).settle()


def test_where_a_router_listens_already_a_server_joins_it(network, new_network, client_of):
    joined = new_network("/robot2/mjplug", listen=network.session.listening)
    assert joined.session.role == "client"
    assert joined.session.endpoint == network.session.endpoint
    assert joined.session.listening == ()
    joined.open_service(ServiceName("/go", Trigger), lambda call: call.respond(Trigger.Response(success=True)))
    matched = threading.Event()
    publisher = joined.open_publisher(Topic("/x", String, DEFAULT), matched.set)
    client = client_of(network.session.endpoint)
    assert client.call("go").json["success"] is True
    assert client.call("robot2/mjplug/interfaces").json["name"] == "/robot2/mjplug"
    samples = client.listen("x")
    assert matched.wait(TIMEOUT)
    publisher.publish(String(data="hello"))
    assert bytes(samples.get(timeout=TIMEOUT).payload) == String(data="hello").to_cdr()


def test_two_servers_on_one_network_talk_to_each_other(network, new_network):
    joined = new_network("/robot2/mjplug", listen=network.session.listening)
    messages = queue.SimpleQueue()
    network.open_subscription(Topic("/x", String, DEFAULT), messages.put)
    matched = threading.Event()
    publisher = joined.open_publisher(Topic("/x", String, DEFAULT), matched.set)
    assert matched.wait(TIMEOUT)
    publisher.publish(String(data="hello"))
    assert messages.get(timeout=TIMEOUT) == String(data="hello")


def test_a_foreign_program_on_the_port_is_named_with_the_way_out(foreign):
    with pytest.raises(WireError) as refused:
        open_session(SessionSettings(listen=(foreign,)), "/mjplug")
    sentence = str(refused.value)
    assert sentence.startswith(f"{foreign} is in use by another program that does not speak Zenoh")
    assert "--listen tcp/127.0.0.1:0 for any free port" in sentence


def test_a_router_that_must_be_one_does_not_join(network):
    with pytest.raises(WireError, match="is in use by another program; choose another endpoint with --listen, or use"):
        open_session(SessionSettings(mode="router", listen=network.session.listening), "/robot2/mjplug")


def test_a_second_server_of_the_same_name_is_refused(network, new_network):
    with pytest.raises(WireError) as refused:
        new_network("/mjplug", listen=network.session.listening)
    sentence = str(refused.value)
    assert sentence.startswith("a server named /mjplug is already on this network (Zenoh id ")
    assert str(network.session.zenoh.zid()) in sentence
    assert sentence.endswith("stop it, or give this one another namespace, such as --set namespace=robot2")
    network.close()
    new_network("/mjplug", listen=network.session.listening)


def test_a_token_without_a_server_does_not_keep_a_server_from_starting(
    network, client, new_network, monkeypatch, caplog
):
    monkeypatch.setattr(identity, "_HOLDER_TIMEOUT", 0.3)
    kept = client.session.liveliness().declare_token("@mjplug/victim/squatter\x1b[31m")
    client.settle()
    victim = new_network("/victim", listen=network.session.listening)
    assert client.call("victim/interfaces").json["name"] == victim.listing.name == "/victim"
    (warning,) = [line for line in caplog.messages if "announces a server" in line]
    assert "announces a server named /victim, but did not answer within 0.3 s" in warning
    kept.undeclare()


def test_a_server_whose_answer_is_slow_keeps_its_name(network, new_network, client_of, opened):
    slow = client_of(network.session.endpoint)
    slow._kept.append(slow.session.liveliness().declare_token("@mjplug/slow/holder"))

    def answer(query):
        threading.Event().wait(0.4)
        with query:
            query.reply("slow/interfaces", b"{}")

    slow._kept.append(slow.session.declare_queryable("slow/interfaces", answer))
    slow.settle()
    with pytest.raises(WireError, match="a server named /slow is already on this network"):
        new_network("/slow", listen=network.session.listening)


def test_a_flood_of_tokens_of_our_name_does_not_fill_the_log(network, client, caplog):
    declare = client.session.liveliness().declare_token
    kept = [declare(f"@mjplug/mjplug/other{number}") for number in range(150)]
    client.settle()
    errors = [line for line in caplog.messages if "another server named /mjplug appeared" in line]
    assert len(errors) == 3
    assert len(kept) == 150


def test_a_server_of_the_same_name_is_found_behind_the_router(network, new_network):
    new_network("/robot2/mjplug", listen=network.session.listening)
    for mode, listen in (("auto", network.session.listening), ("peer", None), ("client", None)):
        with pytest.raises(WireError, match="a server named /robot2/mjplug is already on this network"):
            new_network("/robot2/mjplug", mode=mode, listen=listen, connect=network.session.listening)


def test_names_that_contain_each_other_are_different(network, new_network):
    new_network("/mjplug/mjplug", listen=network.session.listening)
    new_network("/robot2", listen=network.session.listening)


class Warned(logging.Handler):
    """Waits for the log line about two servers with the same name."""

    def __init__(self):
        super().__init__()
        self._lines = queue.SimpleQueue()

    def emit(self, record):
        self._lines.put(record.getMessage())

    def about(self, *sessions):
        """Returns once each of these servers has been named, by its Zenoh id."""
        missing = {f"Zenoh id {session.zenoh.zid()} is on this network" for session in sessions}
        while missing:
            line = self._lines.get(timeout=2 * TIMEOUT)
            missing = {part for part in missing if part not in line}


@pytest.fixture
def warned():
    handler = Warned()
    logger = logging.getLogger("mjplug.wire.rejections")
    logger.addHandler(handler)
    yield handler
    logger.removeHandler(handler)


def test_networks_with_one_name_that_are_joined_later_report_it(new_network, warned):
    late = on_free_port("tcp/127.0.0.1:0")
    first = new_network("/mjplug", connect=(late,))
    second = new_network("/mjplug", listen=(late,))
    warned.about(first.session, second.session)


def test_a_server_that_was_there_first_is_noticed_in_a_race(network, opened, warned):
    late = opened(open_session(SessionSettings(listen=network.session.listening), "/robot2"))
    identity.claim(late.zenoh, "/mjplug")
    warned.about(network.session)


def test_a_peer_listens_on_a_free_port_and_connects(network, new_network, client):
    peer = new_network("/robot2", mode="peer", listen=None, connect=network.session.listening)
    assert peer.session.role == "peer"
    assert peer.session.endpoint == network.session.endpoint
    assert client.call("robot2/interfaces").json["endpoint"] == network.session.endpoint


def test_a_client_connects_and_listens_nowhere(network, new_network, client):
    joined = new_network("/robot2", mode="client", listen=None, connect=network.session.listening)
    assert (joined.session.role, joined.session.listening) == ("client", ())
    assert client.call("robot2/interfaces").json["name"] == "/robot2"


def test_a_client_without_a_server_reports_where_it_tried(foreign):
    endpoint = on_free_port("tcp/127.0.0.1:0")
    with pytest.raises(WireError, match=f"cannot connect to {endpoint}: Unable to connect"):
        open_session(SessionSettings(mode="client", connect=(endpoint,)), "/mjplug")
    with pytest.raises(WireError, match=r"cannot connect to nowhere: .*must be of the form <protocol>/<address>"):
        open_session(SessionSettings(mode="client", connect=("nowhere",)), "/mjplug")
    with pytest.raises(WireError, match="mode client needs an endpoint to connect to"):
        open_session(SessionSettings(mode="client"), "/mjplug")


@pytest.mark.parametrize(
    ("endpoint", "reason"),
    [
        ("127.0.0.1:7447", "must be of the form <protocol>/<address>"),
        ("tcp/192.0.2.1:0", "Cannot assign requested address"),
        ("tcp/192.0.2.1:7447", "Cannot assign requested address"),
        ("tcp/nowhere.invalid:7447", "failed to lookup"),
    ],
)
def test_an_endpoint_that_cannot_be_is_named_with_the_reason(endpoint, reason):
    with pytest.raises(WireError) as refused:
        open_session(SessionSettings(listen=(endpoint,)), "/mjplug")
    sentence = str(refused.value)
    assert sentence.startswith(f"cannot listen on {endpoint}: ")
    assert reason in sentence
    assert ".rs" not in sentence


def test_a_configuration_file_is_merged(tmp_path, new_network, client_of):
    endpoint = on_free_port("tcp/127.0.0.1:0")
    file = tmp_path / "zenoh.json5"
    file.write_text(f'{{ listen: {{ endpoints: ["{endpoint}"] }}, adminspace: {{ enabled: true }} }} // a comment')
    network = new_network(listen=None, config=file)
    assert network.session.listening == (endpoint,)
    client = client_of(endpoint)
    zid = network.session.zenoh.zid()
    assert client.call(f"@/{zid}/router").json["zid"] == str(zid)


def test_settings_win_over_the_file_and_the_file_gives_the_mode(tmp_path, network, new_network):
    file = tmp_path / "zenoh.json5"
    file.write_text(f'{{ mode: "client", connect: {{ endpoints: ["{network.session.endpoint}"] }} }}')
    assert new_network("/robot2", listen=None, config=file).session.role == "client"
    assert new_network("/robot3", mode="router", config=file).session.role == "router"


@pytest.mark.parametrize("text", ["{ mode: ", "{ listen: { endpoints: [7447] } }"])
def test_a_broken_configuration_file_is_named(tmp_path, text):
    file = tmp_path / "zenoh.json5"
    file.write_text(text)
    with pytest.raises(WireError, match=f"cannot use the Zenoh configuration file {file}: "):
        open_session(SessionSettings(config=file), "/mjplug")
    with pytest.raises(WireError, match=r"cannot use the Zenoh configuration file .*missing\.json5: "):
        open_session(SessionSettings(config=tmp_path / "missing.json5"), "/mjplug")


def test_free_ports_are_chosen_for_zero_only():
    assert with_free_port("tcp/127.0.0.1:7447") == "tcp/127.0.0.1:7447"
    assert with_free_port("unixsock-stream/tmp/x") == "unixsock-stream/tmp/x"
    assert with_free_port("tls/127.0.0.1:0#x=y").startswith("tls/127.0.0.1:")
    assert with_free_port("tls/127.0.0.1:0#x=y").endswith("#x=y")
    assert with_free_port("udp/127.0.0.1:0") != "udp/127.0.0.1:0"
    assert on_free_port("tcp/0.0.0.0:7447").startswith("tcp/0.0.0.0:")
    assert on_free_port("tcp/0.0.0.0:7447") != "tcp/0.0.0.0:7447"


def test_a_listener_on_all_addresses_is_dialled_on_loopback():
    assert dialable("tcp/0.0.0.0:7447") == "tcp/127.0.0.1:7447"
    assert dialable("tcp/[::]:7447#x=y") == "tcp/[::1]:7447#x=y"
    assert dialable("tcp/10.0.0.1:7447") == "tcp/10.0.0.1:7447"


SERVER = """
import sys
from mjplug.contracts.transport import DEFAULT, ServiceName, Topic
from mjplug.wire.network import open_network
from mjplug.wire.session import SessionSettings
from mjplug_schemas.std_msgs import String
from mjplug_schemas.std_srvs import Trigger
network = open_network(SessionSettings(listen=("tcp/127.0.0.1:0",)), "/mjplug")
network.open_publisher(Topic("/x", String, DEFAULT), print)
network.open_subscription(Topic("/y", String, DEFAULT), print)
network.open_service(ServiceName("/go", Trigger), print)
print(network.session.endpoint, flush=True)
"""


def test_a_process_that_forgets_to_close_still_ends():
    ended = subprocess.run([sys.executable, "-c", SERVER], capture_output=True, text=True, timeout=15, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout.startswith("tcp/127.0.0.1:")


class Hanging:
    """A session of Zenoh that is being closed until `released`."""

    def __init__(self, error=None):
        self.released = threading.Event()
        self.error = error
        self.closed = False

    def is_closed(self):
        return self.closed

    def close(self):
        self.closed = True
        self.released.wait()
        if self.error is not None:
            raise self.error


def test_clients_that_do_not_read_delay_the_end_of_a_session_for_a_limited_time(caplog, monkeypatch):
    monkeypatch.setattr(session_module, "CLOSE_TIMEOUT", 0.01)
    hanging = Hanging()
    session = WireSession(hanging, "router", ("tcp/127.0.0.1:7",), ())
    with caplog.at_level(logging.INFO):
        session.close()
        session.close()
    hanging.released.set()
    assert caplog.messages == ["a client does not read; the session is not closed yet after 0.01 s"]


def test_a_session_that_cannot_be_closed_is_an_error():
    broken = Hanging(zenoh.ZError("no"))
    broken.released.set()
    with pytest.raises(zenoh.ZError, match="no"):
        WireSession(broken, "router", ("tcp/127.0.0.1:7",), ()).close()
