"""Two servers in one network with the same names both log a warning."""

import json
import logging
import queue
from dataclasses import replace

import pytest
from waits import TIMEOUT

from mjplug.contracts.actions import ActionName
from mjplug.contracts.transport import DEFAULT, ServiceName, Topic
from mjplug.wire.discovery.answers import ActionEntry, Listing, ServiceEntry, TopicEntry
from mjplug.wire.shared_names import TRANSFORMS, SharedNames, shared_names
from mjplug_schemas.control_msgs_action import GripperCommand
from mjplug_schemas.diagnostic_msgs import DiagnosticArray
from mjplug_schemas.geometry_msgs import Twist
from mjplug_schemas.rcl_interfaces import Log
from mjplug_schemas.rosgraph_msgs import Clock
from mjplug_schemas.std_srvs import Trigger
from mjplug_schemas.tf2_msgs import TFMessage


def declared(published=(), subscribed=(), services=(), name="/mjplug"):
    """A listing with these topics and services."""
    return Listing(
        name,
        "0",
        "tcp/127.0.0.1:1",
        (
            *(TopicEntry(Topic(n, t, DEFAULT), "published", {}) for n, t in published),
            *(TopicEntry(Topic(n, t, DEFAULT), "subscribed", {}) for n, t in subscribed),
        ),
        tuple(ServiceEntry(ServiceName(n, Trigger), {}) for n in services),
    )


def compared(own, other, exempt=()):
    return shared_names(own, json.loads(other.to_json()), exempt)


def test_every_shared_topic_and_service_is_found_by_direction():
    own = declared([("/clock", Clock), ("/scan", Clock)], [("/cmd_vel", Twist)], ["/push", "/mjplug/x"])
    other = declared(
        [("/clock", Clock), ("/cmd_vel", Twist)], [("/cmd_vel", Twist), ("/scan", Clock)], ["/push", "/b/x"]
    )
    assert compared(own, other) == SharedNames(("/clock",), ("/cmd_vel",), ("/push",))
    assert compared(own, declared()) == SharedNames((), (), ())


def test_shared_actions_are_found_and_named():
    action = ActionEntry(ActionName("/arm/move", GripperCommand), {}, (), ())
    own, other = (replace(declared(name=name), actions=(action,)) for name in ("/a", "/b"))
    shared = compared(own, other)
    assert shared == SharedNames((), (), (), ("/arm/move",))
    assert "both offer the action /arm/move" in shared.sentence("/a", "/b")
    # A server of an earlier version lists no actions.
    earlier = json.loads(other.to_json())
    del earlier["actions"]
    assert shared_names(own, earlier) == SharedNames((), (), ())


def test_topics_that_nodes_share_by_convention_are_left_out():
    topics = [("/rosout", Log), ("/diagnostics", DiagnosticArray), ("/tf", TFMessage)]
    assert compared(declared(topics), declared(topics)) == SharedNames(("/tf",), (), ())
    assert compared(declared(topics), declared(topics), (TRANSFORMS,)) == SharedNames((), (), ())


def test_the_sentence_says_what_helps_against_just_these_names():
    shared = SharedNames(("/clock", "/scan"), ("/cmd_vel",), ())
    same = shared.sentence("/a", "/b")
    assert "both publish /clock, /scan; both subscribe to /cmd_vel. " in same
    assert same.endswith(
        "such as --set namespace=robot2, which moves all names that are not absolute, and give absolute names a place "
        "in the namespace, such as --set 'remap./clock={ns}/clock'"
    )
    other = SharedNames((), (), ("/push",)).sentence("/r1/a", "/r2/a")
    assert "namespace=robot2" not in other
    assert other.endswith("--set 'remap./push={ns}/push'")
    assert SharedNames((), (), ()).sentence("/a", "/b") == ""


def test_a_server_without_a_namespace_is_not_told_to_use_its_own():
    """`{ns}/clock` is `/clock` there, so only the other server can move the name."""
    shared = SharedNames(("/clock",), (), ())
    for own, other in (("/mjplug", "/robot2/mjplug"), ("/robot2/mjplug", "/mjplug")):
        assert ": in /robot2/mjplug, give absolute names a place" in shared.sentence(own, other)
    assert ": give absolute names a place" in shared.sentence("/robot1/mjplug", "/robot2/mjplug")


class Warnings(logging.Handler):
    """The warnings about shared names, as they come."""

    def __init__(self):
        super().__init__(logging.WARNING)
        self.came = queue.SimpleQueue()

    def emit(self, record):
        self.came.put(record.getMessage())

    def next(self):
        return self.came.get(timeout=TIMEOUT)


@pytest.fixture
def warnings():
    handler, logger = Warnings(), logging.getLogger("mjplug.wire.shared_names")
    logger.addHandler(handler)
    yield handler
    logger.removeHandler(handler)


@pytest.fixture
def server(new_network):
    """Opens a network with published topics, and starts its watch for shared names."""

    def server(name, *topics, ready=True, **settings):
        network = new_network(name, **settings)
        for topic in topics:
            network.open_publisher(Topic(topic, Clock, DEFAULT))
        if ready:
            network.watch_shared_names()
        return network

    return server


def test_both_servers_warn_whichever_is_first(server, warnings):
    first = server("/a", "/clock", "/x")
    server("/b", "/clock", "/y", listen=first.session.listening)
    told = {warnings.next(), warnings.next()}
    assert {sentence.partition(" on the same network")[0] for sentence in told} == {
        "this server and /a", "this server and /b",
    }  # fmt: skip
    assert all("both publish /clock. " in sentence for sentence in told)


def test_both_servers_warn_if_they_become_ready_at_the_same_time(server, warnings):
    first = server("/a", "/clock", ready=False)
    second = server("/b", "/clock", listen=first.session.listening, ready=False)
    first.watch_shared_names()
    second.watch_shared_names()
    told = [warnings.next(), warnings.next()]
    assert sorted(sentence.split()[3] for sentence in told) == ["/a", "/b"]


def test_servers_that_share_nothing_are_not_warned_about(server, warnings):
    first = server("/a", "/clock", "/x")
    server("/b", "/y", listen=first.session.listening)
    server("/c", "/x", listen=first.session.listening)
    # The first server has compared with /b before.
    told = {warnings.next(), warnings.next()}
    assert {sentence.split()[3] for sentence in told} == {"/a", "/c"}


def test_a_server_that_restarts_is_warned_about_once_by_those_that_stay(server, warnings):
    first = server("/a", "/x")
    for _ in range(2):
        again = server("/b", "/x", listen=first.session.listening)
        assert "/a" in warnings.next() or "/a" in warnings.next()
        again.close()
    server("/c", "/x", listen=first.session.listening)
    told = []
    while not told or not told[-1].startswith("this server and /c"):
        told.append(warnings.next())
    assert len([sentence for sentence in told if sentence.startswith("this server and /b")]) <= 1


@pytest.mark.parametrize(
    "answer",
    [
        b"",
        b"[]",
        b'{"topics": 1, "services": []}',
        b'{"topics": [{}], "services": []}',
        b'{"topics": [{"name": "/x", "direction": "%s"}], "services": []}' % (b"long" * 10000),
        b"[" * 100000,
        b"[" + b"1," * 50001 + b"1]",
        b'"%s"' % (b"long" * (1 << 18)),
    ],
)
def test_a_program_that_poses_as_a_server_does_no_harm(server, client_of, warnings, answer):
    first = server("/a", "/x")
    liar = client_of(first.session.endpoint)
    liar._kept.append(
        liar.session.declare_queryable("liar/interfaces", lambda query: query.reply("liar/interfaces", answer))
    )
    liar._kept.append(liar.session.liveliness().declare_token("@mjplug/liar/1/@ready"))
    warning = warnings.next()
    assert warning.startswith("server /liar on this network replied with an invalid list of interfaces: ")
    assert len(warning) < 300
    server("/b", "/x", listen=first.session.listening)
    # The second server queries the program too.
    told = [warnings.next(), warnings.next(), warnings.next()]
    assert sum("both publish /x. " in sentence for sentence in told) == 2


def test_a_program_that_announces_a_server_and_never_answers_does_not_hold_up_the_end(server, client_of):
    first = server("/a", "/x")
    liar = client_of(first.session.endpoint)
    kept = []
    asked = queue.SimpleQueue()

    def keep(query):
        kept.append(query)
        asked.put(None)

    liar._kept.append(liar.session.declare_queryable("liar/interfaces", keep))
    liar._kept.append(liar.session.liveliness().declare_token("@mjplug/liar/1/@ready"))
    asked.get(timeout=TIMEOUT)
    first.close()
    assert not first._shared._thread.is_alive()
    kept.clear()


def test_a_program_that_changes_its_list_for_ever_does_not_fill_the_log(server, client_of, warnings, monkeypatch):
    monkeypatch.setattr("mjplug.wire.shared_names._MAX_WARNINGS", 2)
    first = server("/a", "/x", "/y")
    liar = client_of(first.session.endpoint)
    asked = queue.SimpleQueue()
    answers = iter(range(100))

    def answer(query):
        name = ("/x", "/y")[next(answers) % 2]
        topics = [{"name": name, "direction": "published"}]
        query.reply("liar/interfaces", json.dumps({"topics": topics, "services": []}))
        asked.put(None)

    liar._kept.append(liar.session.declare_queryable("liar/interfaces", answer))
    for _ in range(4):
        token = liar.session.liveliness().declare_token("@mjplug/liar/1/@ready")
        asked.get(timeout=TIMEOUT)
        token.undeclare()
    told = [warnings.next(), warnings.next()]
    assert told[1].endswith(" (no more warnings of this kind are logged)")
    # A real server at the end: it is compared after the others, and logs its own warning.
    server("/b", "/x", listen=first.session.listening)
    assert warnings.next().startswith("this server and /a ")
