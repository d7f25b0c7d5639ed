"""The parts of recorder and bag on their own."""

import re

import pytest

from mjplug.bag.definitions import class_of, text_of, text_of_class
from mjplug.bag.errors import BagError
from mjplug.bag.topics import qos_from, qos_text
from mjplug.contracts.transport import CLOCK, DEFAULT, LATCHED
from mjplug.recorder.backlog import Backlog
from mjplug.recorder.lives import Lives
from mjplug.recorder.selection import Selection
from mjplug.wire.origin import Origin
from mjplug_schemas import registry
from mjplug_schemas.message import Message
from mjplug_schemas.rihs01 import type_hash


def test_topics_are_selected_as_by_ros2_bag_record():
    every = Selection(all=True)
    assert "/clock" in every
    assert "/arm/_action/feedback" not in every
    assert "/arm/_action/feedback" in Selection(all=True, names=frozenset({"/arm/_action/feedback"}))
    regex = Selection(regex=re.compile("tf|joint"), exclude=re.compile("static"))
    assert [name for name in ("/tf", "/tf_static", "/joint_states", "/clock") if name in regex] == [
        "/tf",
        "/joint_states",
    ]
    # A name that is given is recorded, whatever is excluded.
    assert "/tf_static" in Selection(names=frozenset({"/tf_static"}), exclude=re.compile("static"))
    assert Selection(names=frozenset({"/a", "/b"})).missing(["/b", "/c"]) == ["/a"]


def test_a_backlog_is_bounded_by_bytes():
    backlog = Backlog(10_100)
    assert backlog.put("large", 9_000)
    assert not backlog.put("too much", 1_000)
    assert backlog.put("small", 0)
    assert backlog.take(0.0) == ["large", "small"]
    assert (backlog.size, backlog.take(0.0)) == (0, [])
    assert backlog.put("large", 9_000)
    assert backlog.clear() == ["large"]
    assert backlog.size == 0
    # Larger than all there is.
    assert not backlog.put("never", 10_000)


def test_lives_of_servers():
    one, two, other = (name.encode() * 8 for name in "abc")
    lives = Lives({one: "/robot", two: "/robot", other: ""}.__getitem__)

    def seen(host, epoch, number=1):
        return lives.check(Origin(number, 0, host + bytes(8), 5, epoch))

    assert lives.check(None) == ("", False)
    assert lives.check(Origin(1, 0, one + bytes(8))) == ("", False)
    assert [seen(one, 3), seen(one, 3), seen(other, 7)] == [("", False)] * 3
    assert seen(one, 4) == ("/robot was reset, or a state was restored (epoch 4)", False)
    assert seen(one, 3) == ("", True)
    assert seen(one, 4) == ("", False)
    assert seen(two, 0) == ("/robot was started again", False)
    # The last messages of the process before.
    assert seen(one, 4) == ("", True)
    assert seen(two, 0) == ("", False)
    # A program that is no server, and may send anything.
    assert seen(other, 8) == ("", False)


@pytest.mark.parametrize("qos", [DEFAULT, CLOCK, LATCHED])
def test_a_quality_of_service_is_read_as_it_was_written(qos):
    assert qos_from(qos_text(qos)) == qos


@pytest.mark.parametrize("damaged", ["", "[", "{}", "- depth: x", None, 7, "- {durability: 1}"])
def test_an_unreadable_quality_of_service_is_the_default(damaged):
    assert qos_from(damaged) == DEFAULT


def test_qos_by_names_as_in_version_9_is_read():
    profile = {"depth": 1, "durability": "transient_local", "reliability": "reliable"}
    assert qos_from([profile]) == LATCHED


MESSAGES = [kind for kind in registry.all_types().values() if issubclass(kind, Message)]


def test_the_class_of_a_known_definition_is_the_known_one():
    for kind in MESSAGES:
        assert class_of(kind.TYPE, text_of_class(kind)) is kind


def test_a_class_is_made_from_the_definition_of_an_unknown_type():
    text = (
        "# Comment\nuint8 OPEN=1\nstring TEXT='=1'\n\n"
        "Header header\nPart part\nPart[] parts\nother_msgs/Thing[2] things\n"
        "float64[<=3] few [1.0, 2.0]\nuint8[4] four\nstring<=5 short 'ab'  # Comment\nbool[] flags\n"
        f"{'=' * 80}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
        f"{'=' * 80}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
        f"{'=' * 80}\nMSG: lab_msgs/Part\nint16 x 5\n"
        f"{'=' * 80}\nMSG: other_msgs/Thing\nlab_msgs/Part inner\n"
    )
    kind = class_of("lab_msgs/msg/Whole", text)
    message = kind(short="abc", four=b"1234", few=(1.0,), flags=(True,))
    assert kind.from_cdr(message.to_cdr()) == message
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(text, "lab_msgs/msg/Whole"))
    assert type_hash(kind) == store.hash_rihs01("lab_msgs/msg/Whole")
    theirs = store.deserialize_cdr(message.to_cdr(), "lab_msgs/msg/Whole")
    assert (theirs.short, bytes(theirs.four), [*theirs.flags]) == ("abc", b"1234", [True])


@pytest.mark.parametrize(
    ("text", "why"),
    [("Missing x\n", "missing"), ("lab_msgs/Whole again\n", "recursive"), ("???\n", "is not a field")],
)
def test_a_definition_that_cannot_be_read_is_refused(text, why):
    with pytest.raises(BagError, match=why):
        class_of("lab_msgs/msg/Whole", text)


def test_the_text_of_a_type_contains_the_types_of_its_fields():
    with pytest.raises(BagError, match=r"the definition of b/msg/B is missing, which a/msg/A needs"):
        text_of("a/msg/A", {"a/msg/A": "b/B x\n"})
