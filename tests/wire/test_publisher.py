"""What a publisher does with its outlets; the outlets are lists."""

from typing import ClassVar

import pytest

from mjplug.frame import CdrFrame
from mjplug.transport import DEFAULT, Topic
from mjplug.wire.publisher import WirePublisher
from mjplug_schemas.idl import string
from mjplug_schemas.message import Message
from mjplug_schemas.std_msgs import String


class Counted(Message, package="test_msgs"):
    """Counts how often it is encoded."""

    data: string = ""
    encoded: ClassVar[list[str]] = []

    def to_cdr(self):
        self.encoded.append("cdr")
        return super().to_cdr()

    def to_json(self):
        self.encoded.append("json")
        return super().to_json()


class Outlet:
    def __init__(self, form, matched):
        self.form = form
        self.matched = matched
        self.payloads = []

    def put(self, payload):
        self.payloads.append(payload)


@pytest.fixture
def encoded():
    Counted.encoded.clear()
    return Counted.encoded


def publisher(*outlets):
    return WirePublisher(Topic("/x", Counted, DEFAULT), outlets)


def test_nothing_is_encoded_for_nobody(encoded):
    outlets = [Outlet("cdr", False), Outlet("json", False)]
    one = publisher(*outlets)
    assert not one.matched
    one.publish(Counted(data="a"))
    assert encoded == []
    assert [outlet.payloads for outlet in outlets] == [[], []]


@pytest.mark.parametrize("form", ["cdr", "json"])
def test_only_the_form_that_somebody_wants_is_encoded(encoded, form):
    outlets = [Outlet("cdr", form == "cdr"), Outlet("json", form == "json")]
    one = publisher(*outlets)
    assert one.matched
    one.publish(Counted(data="a"))
    assert encoded == [form]
    assert [len(outlet.payloads) for outlet in outlets] == [int(outlet.form == form) for outlet in outlets]


def test_outlets_of_one_form_share_one_payload(encoded):
    first, second, third, unmatched = (Outlet("cdr", True) for _ in range(4))
    unmatched.matched = False
    json = Outlet("json", True)
    publisher(first, json, second, unmatched, third).publish(Counted(data="a"))
    assert sorted(encoded) == ["cdr", "json"]
    assert first.payloads[0] is second.payloads[0] is third.payloads[0]
    assert unmatched.payloads == []
    assert bytes(json.payloads[0]) == b'{"data":"a"}'
    assert bytes(first.payloads[0]) == b"\0\1\0\0\2\0\0\0a\0"


def test_a_frame_is_put_as_it_is_and_decoded_only_for_json(encoded):
    frame = CdrFrame(Counted(data="a"))
    cdr, json = Outlet("cdr", True), Outlet("json", False)
    one = publisher(cdr, json)
    one.publish_frame(frame)
    assert encoded == []
    assert bytes(cdr.payloads[0]) == frame.payload()
    json.matched = True
    one.publish_frame(frame)
    assert encoded == ["json"]
    assert bytes(json.payloads[0]) == b'{"data":"a"}'


def test_a_message_of_another_type_is_refused():
    one = publisher(Outlet("cdr", True))
    with pytest.raises(TypeError, match="topic /x carries test_msgs/msg/Counted, not String"):
        one.publish(String())
    with pytest.raises(TypeError, match="topic /x carries test_msgs/msg/Counted, not String"):
        one.publish_frame(CdrFrame(String()))
