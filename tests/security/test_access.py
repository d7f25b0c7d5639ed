"""Every door of a server, and who gets through it. Real Zenoh over TLS on 127.0.0.1."""

import queue
from dataclasses import dataclass
from functools import partial
from types import SimpleNamespace

import pytest
import zenoh
from security.conftest import Client
from waits import TIMEOUT
from zenoh.ext import HistoryConfig, declare_advanced_subscriber
from zenoh.handlers import Callback

from mjplug.contracts.actions import ActionCallbacks, ActionName
from mjplug.contracts.transport import DEFAULT, LATCHED, LATEST, ServiceName, Topic
from mjplug.wire.access import READ_ONLY, Interfaces
from mjplug.wire.network import open_network
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.secured import secured
from mjplug.wire.session import SessionSettings
from mjplug_schemas import registry
from mjplug_schemas.action_msgs import GoalStatusArray
from mjplug_schemas.control_msgs_action import GripperCommand
from mjplug_schemas.rcl_interfaces import GetParameters, SetParameters
from mjplug_schemas.std_msgs import String
from mjplug_schemas.std_srvs import SetBool, Trigger

NAME = "/mjplug"
BEAT = Topic("/beat", String, DEFAULT)
DESCRIPTION = Topic("/description", String, LATCHED)
COMMAND = Topic("/arm/command", String, LATEST)
READ = ServiceName("/mjplug/get_parameters", GetParameters)
DIAGNOSTICS = ServiceName("/mjplug/get_diagnostics", Trigger)
WRITE = ServiceName("/mjplug/set_parameters", SetParameters)
SET = ServiceName("/arm/set", SetBool)
TRAP = ServiceName("/arm/interfaces", Trigger)
ROS = RosSettings()
SERVICES = (READ, DIAGNOSTICS, WRITE, SET, TRAP)
TOPICS = (BEAT, DESCRIPTION, COMMAND)
# The second one has a name that matches the keys of lists of interfaces.
ACTIONS = (ActionName("/arm/move", GripperCommand), ActionName("/hand/interfaces", GripperCommand))

ATTACHMENT = (1).to_bytes(8, "little") * 2 + b"\x10" + bytes(16)
"""As rmw_zenoh puts it on every message."""


@dataclass
class Gate:
    """A server, and what has come through its doors."""

    endpoint: str
    called: list[str]
    commanded: "queue.SimpleQueue[str]"
    beat: object
    description: object


@pytest.fixture(scope="module")
def gate(keys):
    settings = SessionSettings(listen=("tls/127.0.0.1:0",), config=keys.path / "server" / "server.json5")
    parts = [service for action in ACTIONS for service in action.services]
    topics = [topic for action in ACTIONS for topic in action.topics]
    published = [BEAT, DESCRIPTION, *topics]
    declared = Interfaces(NAME, published, [COMMAND], [*SERVICES, *parts], ROS, ACTIONS)
    network = open_network(secured(settings, lambda: declared), NAME, ros2=ROS)
    called, commanded = [], queue.SimpleQueue()
    beat, description = network.open_publisher(BEAT), network.open_publisher(DESCRIPTION)
    network.open_subscription(COMMAND, lambda message: commanded.put(message.data))

    def offer(service):
        def deliver(call):
            called.append(service.name)
            call.respond(service.type.Response())

        network.open_service(service, deliver)

    for service in SERVICES:
        offer(service)

    def offer_action(action):
        def respond(call, service):
            called.append(service.name)
            call.respond(service.type.Response())

        def receive(query):
            called.append(action.name)
            query.refuse("a test")

        handlers = [partial(respond, service=service) for service in action.services]
        network.open_action(action, ActionCallbacks(*handlers, receive)).status.publish(GoalStatusArray())

    for action in ACTIONS:
        offer_action(action)
    description.publish(String(data="a robot"))
    yield Gate(network.session.endpoint, called, commanded, beat, description)
    network.close()


@pytest.fixture
def enter(keys, gate, opened):
    """Connects with the certificate of a user."""
    return lambda name: opened(Client(keys.path / f"{name}.json5", gate.endpoint))


def keys_of(topic):
    return topic.name[1:], f"{topic.name[1:]}/@json", ROS.data_key(topic.name, topic.type)


def forms_of(text):
    """A message for each key of a topic."""
    return String(data=text).to_cdr(), f'{{"data":"{text}"}}'.encode(), String(data=text).to_cdr()


def call(client, service):
    """Returns the replies of a service, to a plain client and to a ROS 2 node."""
    request = service.type.Request().to_cdr()
    plain = client.ask(service.name[1:], payload=request, encoding="application/cdr")
    ros = client.ask(
        ROS.data_key(service.name, service.type),
        payload=request,
        attachment=ATTACHMENT,
        target=zenoh.QueryTarget.ALL_COMPLETE,
    )
    return [*plain, *ros]


@pytest.mark.parametrize("name", ["viewer", "operator"])
def test_a_viewer_and_an_operator_hear_every_topic_in_every_form(enter, gate, name):
    client = enter(name)
    heard = {key: client.listen(key) for key in keys_of(BEAT)}
    client.settle()
    for key, form in zip(heard, forms_of("now"), strict=True):
        until = 200
        while heard[key].empty() and (until := until - 1):
            gate.beat.publish(String(data="now"))
            client.settle()
        assert bytes(heard[key].get(timeout=TIMEOUT).payload) == form, key


@pytest.mark.parametrize("name", ["viewer", "operator"])
def test_a_viewer_and_an_operator_get_what_was_latched(enter, name):
    client = enter(name)
    for key, form in zip(keys_of(DESCRIPTION), forms_of("a robot"), strict=True):
        samples = queue.SimpleQueue()
        client.keep(
            declare_advanced_subscriber(
                client.session,
                key,
                Callback(samples.put, indirect=False),
                history=HistoryConfig(detect_late_publishers=True),
            )
        )
        assert bytes(samples.get(timeout=TIMEOUT).payload) == form, key
    # Without a history, a query gets it from the plain keys.
    assert client.ask("description") == [forms_of("a robot")[0]]
    assert client.ask("description/@json") == [forms_of("a robot")[1]]


@pytest.mark.parametrize("name", ["viewer", "operator"])
def test_a_viewer_and_an_operator_see_the_server_and_the_ros_graph(enter, name):
    client = enter(name)
    (server,) = client.tokens("@mjplug/**")
    assert server.startswith("@mjplug/mjplug/")
    kinds = {token.split("/")[5] for token in client.tokens("@ros2_lv/0/**")}
    assert kinds == {"NN", "MP", "MS", "SS"}


@pytest.mark.parametrize(
    ("name", "served"),
    [("viewer", (READ, DIAGNOSTICS)), ("operator", SERVICES)],
)
def test_a_viewer_calls_only_what_changes_nothing_and_an_operator_calls_everything(enter, gate, name, served):
    client = enter(name)
    for service in SERVICES:
        gate.called.clear()
        answers = call(client, service)
        client.settle()
        expected = 2 if service in served else 0
        assert (service.name, len(answers), len(gate.called)) == (service.name, expected, expected)


@pytest.mark.parametrize("action", ACTIONS, ids=lambda action: action.name)
@pytest.mark.parametrize(("name", "served"), [("viewer", False), ("operator", True)])
def test_an_operator_sends_goals_and_a_viewer_only_sees_their_states(enter, gate, name, served, action):
    client = enter(name)
    gate.called.clear()
    goal = action.type.Goal().to_cdr()
    replies = [*client.ask(action.name[1:], payload=goal), *(a for s in action.services for a in call(client, s))]
    client.settle()
    parts = [service.name for service in action.services for _ in range(2)]
    assert gate.called == ([action.name, *parts] if served else [])
    assert len(replies) == len(gate.called)
    states = queue.SimpleQueue()
    client.keep(
        declare_advanced_subscriber(
            client.session,
            f"{action.name[1:]}/_action/status",
            Callback(states.put, indirect=False),
            history=HistoryConfig(detect_late_publishers=True, max_samples=1),
        )
    )
    assert GoalStatusArray.from_cdr(bytes(states.get(timeout=TIMEOUT).payload)) == GoalStatusArray()


@pytest.mark.parametrize("selector", ["**", "mjplug/*", "arm/**", "0/**", "*/set_parameters", "arm/s$*", "**/@json"])
def test_a_viewer_cannot_call_with_wildcards(enter, gate, selector):
    client = enter("viewer")
    gate.called.clear()
    assert client.ask(selector, payload=SetBool.Request().to_cdr(), attachment=ATTACHMENT) == []
    client.settle()
    assert gate.called == []


def publish(client, topic, text):
    for key, form in zip(keys_of(topic), forms_of(text), strict=True):
        encoding = "application/json" if key.endswith("@json") else "application/cdr"
        client.session.put(
            key, form, encoding=encoding, attachment=ATTACHMENT, congestion_control=zenoh.CongestionControl.BLOCK
        )


@pytest.mark.parametrize(("name", "arrive"), [("viewer", 0), ("operator", 3)])
def test_an_operator_commands_in_every_form_and_a_viewer_in_none(enter, gate, name, arrive):
    client = enter(name)
    client.settle()
    publish(client, COMMAND, name)
    client.settle()
    got = [gate.commanded.get(timeout=TIMEOUT) for _ in range(arrive)]
    assert got == [name] * arrive
    assert gate.commanded.empty()


@pytest.mark.parametrize("name", ["viewer", "operator"])
@pytest.mark.parametrize("key", ["**", "*", "arm/*", "arm/**", "0/**", "**/@json", "$*eat", "beat", "description"])
def test_neither_a_viewer_nor_an_operator_publishes_with_wildcards_or_in_place_of_the_server(enter, gate, name, key):
    client, other = enter(name), enter("viewer")
    heard = [other.listen(one) for topic in (BEAT, DESCRIPTION) for one in keys_of(topic)]
    other.settle()
    client.settle()
    for form in forms_of("forged")[:2]:
        client.session.put(key, form, congestion_control=zenoh.CongestionControl.BLOCK)
    client.session.delete(key)
    client.settle()
    other.settle()
    assert [samples.qsize() for samples in heard] == [0] * 6
    assert gate.commanded.empty()


@pytest.mark.parametrize("name", ["viewer", "operator"])
def test_neither_a_viewer_nor_an_operator_forges_a_message_of_a_ros_topic(enter, name):
    client, other = enter(name), enter("viewer")
    heard = [other.listen(key) for key in keys_of(BEAT)]
    other.settle()
    publish(client, BEAT, "forged")
    client.settle()
    other.settle()
    assert [samples.qsize() for samples in heard] == [0] * 3


@pytest.mark.parametrize("name", ["viewer", "operator"])
@pytest.mark.parametrize("key", ["arm/set", "**", "mjplug/*", "arm/other", f"{SET.name[1:]}/@adv/x"])
def test_neither_a_viewer_nor_an_operator_answers_in_place_of_the_server(enter, name, key):
    client, other = enter(name), enter("operator")
    asked = set()
    # Without keeping the query, which ends when it is dropped.
    handler = Callback(lambda query: asked.add(str(query.key_expr)), indirect=False)
    client.keep(client.session.declare_queryable(key, handler, complete=True))
    client.settle()
    assert len(call(other, SET)) == 2
    assert len(other.ask("arm/other")) == 0
    # Its own query reaches it, without leaving its session.
    assert asked <= {"mjplug/interfaces"}


@pytest.mark.parametrize("name", ["viewer", "operator"])
@pytest.mark.parametrize(
    "token",
    ["@mjplug/mjplug/abc", "@mjplug/other/abc", "@ros2_lv/0/abc/0/0/NN/%/%/mjplug",
     "@ros2_lv/0/abc/0/1/SS/%/%/mjplug/%arm%set/t/h/q"],
)  # fmt: skip
def test_neither_a_viewer_nor_an_operator_appears_as_a_server(enter, name, token):
    client, other = enter(name), enter("operator")
    client.keep(client.session.liveliness().declare_token(token))
    client.settle()
    assert token not in other.tokens(f"{token.split('/')[0]}/**")


@pytest.mark.parametrize(("name", "seen"), [("viewer", False), ("operator", True)])
def test_an_operator_appears_in_the_ros_graph_as_a_node_of_its_own(enter, name, seen):
    client, other = enter(name), enter("viewer")
    token = "@ros2_lv/0/abc/0/0/NN/%/%/teleop"
    client.keep(client.session.liveliness().declare_token(token))
    client.settle()
    assert (token in other.tokens("@ros2_lv/**")) is seen


def test_a_worker_publishes_what_the_server_publishes_and_commands_nothing(enter, gate):
    client, other = enter("worker"), enter("viewer")
    heard = [other.listen(key) for key in keys_of(BEAT)]
    other.settle()
    publish(client, BEAT, "an image")
    assert [bytes(samples.get(timeout=TIMEOUT).payload) for samples in heard] == [*forms_of("an image")]
    gate.called.clear()
    assert [call(client, service) for service in SERVICES] == [[]] * len(SERVICES)
    publish(client, COMMAND, "worker")
    other.settle()
    assert gate.called == []
    assert gate.commanded.empty()


@pytest.mark.parametrize(("name", "through"), [("viewer", []), ("operator", ["mjplug/@view/drag"])])
def test_of_the_view_a_viewer_may_look_and_an_operator_may_drag(enter, name, through):
    worker, client = enter("worker"), enter(name)
    frames, dragged = client.listen("mjplug/@view/frame"), worker.listen("mjplug/@view/drag")
    scene = Callback(lambda query: query.reply("mjplug/@view/scene", b"scene"), indirect=False)
    worker.keep(worker.session.declare_queryable("mjplug/@view/scene", scene))
    while not (answers := client.ask("mjplug/@view/scene")):
        pass
    assert answers == [b"scene"]
    while frames.empty():
        worker.session.put("mjplug/@view/frame", b"frame")
        client.ask("mjplug/@view/scene")
    assert bytes(frames.get().payload) == b"frame"
    for key in ("mjplug/@view/drag", "mjplug/@view/frame", "mjplug/@view/*"):
        client.session.put(key, b"pull", congestion_control=zenoh.CongestionControl.BLOCK)
    client.ask("mjplug/@view/scene")
    got = [str(dragged.get(timeout=TIMEOUT).key_expr) for _ in through]
    assert (got, dragged.qsize()) == (through, 0)


@pytest.mark.parametrize("name", ["bob", "eve"])
def test_a_revoked_or_expired_certificate_cannot_connect(keys, gate, name):
    with pytest.raises(zenoh.ZError):
        Client(keys.path / f"{name}.json5", gate.endpoint, patience_ms=1000)


def test_connecting_without_a_certificate_fails(keys, gate, tmp_path):
    file = tmp_path / "nobody.json5"
    file.write_text(f'{{mode: "client", transport: {{link: {{tls: {{root_ca_certificate: "{keys.path}/ca.pem"}}}}}}}}')
    with pytest.raises(zenoh.ZError):
        Client(file, gate.endpoint, patience_ms=1000)


def test_every_type_of_service_that_sounds_harmless_is_decided_upon():
    # A new one belongs into READ_ONLY, or here.
    commands = set()
    known = {type_.TYPE for type_ in registry.all_types().values() if hasattr(type_, "Request")}
    assert known >= READ_ONLY
    sounds = {name for name in known if name.rpartition("/")[2].startswith(("Get", "List", "Describe"))}
    assert sounds - commands == READ_ONLY


def test_the_viewers_rules_name_no_command():
    from mjplug.wire.access import access_control

    rules = access_control(Interfaces(NAME, [BEAT], [COMMAND], SERVICES, ROS), {"v": "viewer"}, "cert_common_names")
    assert rules["default_permission"] == "deny"
    assert [subject["id"] for subject in rules["subjects"]] == ["viewer"]
    ingress = [rule for rule in rules["rules"] if rule["flows"] == ["ingress"] and rule["permission"] == "allow"]
    may = {message for rule in ingress for message in rule["messages"]}
    assert may == {"declare_subscriber", "liveliness_query", "declare_liveliness_subscriber", "query"}
    assert SimpleNamespace(**ingress[-1]).messages == ["query"]
