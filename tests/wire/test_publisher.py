"""What a publisher does with its writers; the writers are lists."""

from typing import ClassVar

import pytest

from mjplug.contracts.cdr_frame import CdrFrame
from mjplug.contracts.transport import DEFAULT, Topic
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


class KeyWriter:
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


def publisher(*writers):
    return WirePublisher(Topic("/x", Counted, DEFAULT), writers)


def test_nothing_is_encoded_without_subscribers(encoded):
    writers = [KeyWriter("cdr", False), KeyWriter("json", False)]
    one = publisher(*writers)
    assert not one.matched
    one.publish(Counted(data="a"))
    assert encoded == []
    assert [writer.payloads for writer in writers] == [[], []]


@pytest.mark.parametrize("form", ["cdr", "json"])
def test_only_the_requested_encoding_is_encoded(encoded, form):
    writers = [KeyWriter("cdr", form == "cdr"), KeyWriter("json", form == "json")]
    one = publisher(*writers)
    assert one.matched
    one.publish(Counted(data="a"))
    assert encoded == [form]
    assert [len(writer.payloads) for writer in writers] == [int(writer.form == form) for writer in writers]


def test_outlets_of_one_form_share_one_payload(encoded):
    first, second, third, unmatched = (KeyWriter("cdr", True) for _ in range(4))
    unmatched.matched = False
    json = KeyWriter("json", True)
    publisher(first, json, second, unmatched, third).publish(Counted(data="a"))
    assert sorted(encoded) == ["cdr", "json"]
    assert first.payloads[0] is second.payloads[0] is third.payloads[0]
    assert unmatched.payloads == []
    assert bytes(json.payloads[0]) == b'{"data":"a"}'
    assert bytes(first.payloads[0]) == b"\0\1\0\0\2\0\0\0a\0"


def test_a_frame_is_put_as_it_is_and_decoded_only_for_json(encoded):
    frame = CdrFrame(Counted(data="a"))
    cdr, json = KeyWriter("cdr", True), KeyWriter("json", False)
    one = publisher(cdr, json)
    one.publish_frame(frame)
    assert encoded == []
    assert bytes(cdr.payloads[0]) == frame.payload()
    json.matched = True
    one.publish_frame(frame)
    assert encoded == ["json"]
    assert bytes(json.payloads[0]) == b'{"data":"a"}'


def test_a_message_of_another_type_is_refused():
    one = publisher(KeyWriter("cdr", True))
    with pytest.raises(TypeError, match="topic /x has type test_msgs/msg/Counted, not String"):
        one.publish(String())
    with pytest.raises(TypeError, match="topic /x has type test_msgs/msg/Counted, not String"):
        one.publish_frame(CdrFrame(String()))
