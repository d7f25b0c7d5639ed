"""What a client sees of a network with several servers, some of them in trouble."""

import json
import logging

import pytest
import zenoh
from waits import until
from wire.conftest import client_config

from mjplug.client import UnknownNameError, confirmation, connect
from mjplug.contracts.transport import DEFAULT, LATCHED, ServiceName, Topic
from mjplug.wire.discovery import announced, questions
from mjplug.wire.discovery.format import UnreadableListError, read
from mjplug.wire.network import open_network
from mjplug.wire.session import SessionSettings
from mjplug_schemas.std_msgs import Float64, String
from mjplug_schemas.std_srvs import Trigger


@pytest.fixture(scope="module")
def networks():
    """Ten servers on one network: /robot0/mjplug to /robot9/mjplug."""
    first = open_network(SessionSettings(listen=("tcp/127.0.0.1:0",)), "/robot0/mjplug")
    where = SessionSettings(mode="client", connect=first.session.listening)
    opened = [first, *(open_network(where, f"/robot{number}/mjplug") for number in range(1, 10))]
    for number, network in enumerate(opened):
        network.open_publisher(Topic(f"/robot{number}/level", Float64, LATCHED))
        network.open_service(
            ServiceName(f"/robot{number}/mjplug/go", Trigger),
            lambda call, number=number: call.respond(Trigger.Response(success=True, message=str(number))),
        )
    yield opened
    for network in reversed(opened):
        network.close()


@pytest.fixture
def client(networks):
    with connect(networks[0].session.endpoint) as client:
        yield client


@pytest.fixture
def stranger(networks):
    """A bare Zenoh session on the network."""
    with zenoh.open(client_config(networks[0].session.endpoint)) as session:
        yield session


class Asked:
    """Counts the queries that reach `<name>/interfaces` keys, as one more queryable on all of them."""

    def __init__(self, monkeypatch):
        self.names = []
        ask = questions.ask
        monkeypatch.setattr(
            questions, "ask", lambda session, name, *rest: self.names.append(name) or ask(session, name)
        )
        everyone = questions.ask_all
        monkeypatch.setattr(questions, "ask_all", lambda session: self.names.append("all") or everyone(session))


def test_all_servers_are_asked_with_one_query(client, monkeypatch):
    asked = Asked(monkeypatch)
    servers = client.servers()
    assert list(servers) == [f"/robot{number}/mjplug" for number in range(10)]
    for number in range(10):
        assert f"/robot{number}/level" in servers[f"/robot{number}/mjplug"].topics
    assert asked.names == ["all"]


def test_a_name_below_a_server_or_its_namespace_is_asked_of_that_server_only(client, monkeypatch):
    asked = Asked(monkeypatch)
    assert client.call("/robot7/mjplug/go").message == "7"
    client.subscribe("/robot3/level").close()
    client.publisher("/robot4/level").close()
    assert asked.names == ["/robot7/mjplug", "/robot3/mjplug", "/robot4/mjplug"]


def test_a_name_that_the_nearest_server_does_not_have_is_asked_of_all(client, networks, monkeypatch):
    networks[2].open_publisher(Topic("/robot5/foreign", String, LATCHED))
    asked = Asked(monkeypatch)
    client.subscribe("/robot5/foreign").close()
    assert asked.names == ["/robot5/mjplug", "all"]
    with pytest.raises(UnknownNameError, match="unknown service '/robot5/nothing'"):
        client.call("/robot5/nothing")


def test_a_server_that_does_not_answer_is_named_and_not_left_out_silently(client, stranger, monkeypatch, caplog):
    monkeypatch.setattr(announced, "QUERY_TIMEOUT", 0.5)
    kept = []
    hung = stranger.declare_queryable("hung/mjplug/interfaces", kept.append)
    token = stranger.liveliness().declare_token("@mjplug/hung/mjplug/1")
    bare = stranger.liveliness().declare_token("@mjplug/bare/mjplug/1")
    until(lambda: len(client.nodes()) == 12)
    for _ in range(2):
        assert len(client.servers()) == 10
    lines = [line for line in caplog.messages if "; it is omitted" in line]
    assert len(lines) == 2
    assert any(line.startswith("server /hung/mjplug is announced but did not answer within 0.5") for line in lines)
    assert any(line.startswith("server /bare/mjplug is announced but did not answer within ") for line in lines)
    with pytest.raises(UnknownNameError, match="announced, but not answering: /bare/mjplug, /hung/mjplug"):
        client.topic("/other")
    kept.clear()
    hung.undeclare()
    token.undeclare()
    bare.undeclare()


def test_a_server_that_is_slow_once_is_asked_again(client, stranger, monkeypatch, caplog):
    monkeypatch.setattr(announced, "QUERY_TIMEOUT", 1.0)
    told = {"name": "/slow/mjplug", "version": "1", "endpoint": "", "topics": [], "services": []}
    asked = []

    def answer(query):
        asked.append(query)
        if len(asked) > 1:
            with query:
                query.reply("slow/mjplug/interfaces", json.dumps(told).encode())

    queryable = stranger.declare_queryable("slow/mjplug/interfaces", answer)
    token = stranger.liveliness().declare_token("@mjplug/slow/mjplug/1")
    until(lambda: "/slow/mjplug" in client.nodes())
    with caplog.at_level(logging.WARNING):
        assert "/slow/mjplug" in client.servers()
    assert not [line for line in caplog.messages if "; it is omitted" in line]
    assert len(asked) == 2
    asked.clear()
    queryable.undeclare()
    token.undeclare()


@pytest.mark.timeout(40)
def test_a_program_that_matches_every_key_and_never_answers_does_not_delay_others(
    client, networks, stranger, monkeypatch
):
    monkeypatch.setattr(announced, "QUERY_TIMEOUT", 80.0)
    monkeypatch.setattr(announced, "RETRY", 80.0)
    monkeypatch.setattr(confirmation, "_TIMEOUT", 80.0)
    networks[1].open_publisher(Topic("/absolute", Float64, DEFAULT))
    unanswered = []
    everything = stranger.declare_queryable("**", unanswered.append)

    def asked():
        client.session.get("proof", timeout=0.1)
        return unanswered

    until(asked)
    assert len(client.servers()) == 10
    client.subscribe("/absolute").close()
    assert client.call("/robot7/mjplug/go", timeout=80.0).message == "7"
    everything.undeclare()
    unanswered.clear()


@pytest.mark.parametrize("name", ["z\x1b[31m", "a b", "`touch x`", "1st", "x\nFORGED"])
def test_a_token_with_a_name_that_ros_does_not_allow_is_no_server(client, stranger, name):
    token = stranger.liveliness().declare_token(f"@mjplug/evil/{name}/1")
    proof = stranger.liveliness().declare_token("@mjplug/proof/mjplug/1")
    until(lambda: "/proof/mjplug" in client.nodes())
    assert [node for node in client.nodes() if not node.startswith("/robot")] == ["/proof/mjplug"]
    token.undeclare()
    proof.undeclare()


@pytest.mark.parametrize(
    "change",
    [
        {"name": "/other"},
        {"topics": [{"name": "/a\x1b[31m", "type": "std_msgs/msg/String"}]},
        {"services": [{"name": "/a", "type": "std_srvs/srv/Trigger\nFORGED", "hash": "", "key": "a"}]},
        {"services": [{"name": "/a", "type": "std_srvs/srv/Trigger", "hash": "", "key": "a" * 65536}]},
        {"topics": "none"},
        {"topics": 5},
    ],
)
def test_a_list_that_cannot_be_trusted_is_refused(change):
    told = {"name": "/x", "version": "1", "endpoint": "", "topics": [], "services": []}
    assert read("/x", json.dumps(told).encode()).name == "/x"
    with pytest.raises(UnreadableListError, match="server /x sent a list of interfaces that cannot be read"):
        read("/x", json.dumps(told | change).encode())
