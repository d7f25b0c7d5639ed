import logging

import pytest
from hypothesis import given
from hypothesis import strategies as st
from zenoh import Encoding, ZBytes

from mjplug.errors import WireError
from mjplug.wire.encoding import Decoder, Limits, PayloadError, Received, encoding_of
from mjplug.wire.refusal import refusal
from mjplug.wire.rejections import Rejections
from mjplug_schemas.idl import boolean, string
from mjplug_schemas.message import Message
from mjplug_schemas.mujoco_ros2_control_msgs import ApplyExternalWrench, SetPause
from mjplug_schemas.std_msgs import String
from mjplug_schemas.std_srvs import Empty, SetBool

HELLO = String(data="hello")
CDR = b"\0\1\0\0\x06\0\0\0hello\0"
BIG_ENDIAN_CDR = b"\0\0\0\0\0\0\0\x06hello\0"
JSON = b'{"data": "hello"}'


def decode(payload, encoding=None, decoder=None, only=None):
    received = Received(None if payload is None else ZBytes(payload), encoding and Encoding(encoding), only)
    return (decoder or Decoder(String)).decode(received)


@pytest.mark.parametrize("encoding", [None, "zenoh/bytes", "zenoh/string", "application/octet-stream", "text/plain"])
@pytest.mark.parametrize(
    ("payload", "form"), [(CDR, "cdr"), (BIG_ENDIAN_CDR, "cdr"), (JSON, "json"), (b" \n" + JSON, "json")]
)
def test_a_payload_that_does_not_say_what_it_is_is_recognised(encoding, payload, form):
    assert decode(payload, encoding) == (form, HELLO)


@pytest.mark.parametrize(
    ("encoding", "payload", "form"),
    [
        ("application/cdr", CDR, "cdr"),
        ("application/cdr;std_msgs/msg/String", CDR, "cdr"),
        ("application/json", JSON, "json"),
        ("application/json;std_msgs/msg/String", JSON, "json"),
        ("text/json", JSON, "json"),
    ],
)
def test_a_stated_encoding_is_followed(encoding, payload, form):
    assert decode(payload, encoding) == (form, HELLO)


@pytest.mark.parametrize(
    ("encoding", "payload", "sentence"),
    [
        (
            "application/protobuf",
            CDR,
            "the encoding is 'application/protobuf'; only application/cdr and application/json are",
        ),
        (
            "application/cdr;geometry_msgs/msg/Twist",
            CDR,
            "the encoding states the type 'geometry_msgs/msg/Twist'; 'std_msgs/msg/",
        ),
        (None, b"\xff\xfe\xfd\xfc\xfb", "the payload starts with ff fe fd fc, so it is neither CDR nor a JSON object"),
        (None, b"", "the payload is empty, so it is neither CDR nor a JSON object"),
        (None, None, "the payload is empty"),
        (None, b"[1]", "the payload starts with 5b 31 5d, so it is neither"),
        ("application/cdr", JSON, "std_msgs/msg/String: expected a 4-byte CDR header"),
    ],
)
def test_what_cannot_be_decoded_is_explained(encoding, payload, sentence):
    with pytest.raises(PayloadError) as refused:
        decode(payload, encoding)
    assert str(refused.value).startswith(sentence)


@given(st.binary(max_size=60), st.sampled_from([None, "application/cdr", "application/json"]))
def test_garbage_is_a_message_or_a_payload_error_and_nothing_else(payload, encoding):
    try:
        form, message = decode(payload, encoding, Decoder(SetPause.Request))
    except PayloadError:
        return
    assert isinstance(message, SetPause.Request)
    assert form in ("cdr", "json")


def test_the_key_for_json_takes_nothing_else():
    assert decode(JSON, None, only="json") == ("json", HELLO)
    with pytest.raises(PayloadError, match="the encoding is 'application/cdr'; only JSON is accepted on this key"):
        decode(CDR, "application/cdr", only="json")
    with pytest.raises(PayloadError, match="std_msgs/msg/String"):
        decode(CDR, None, only="json")


def test_an_empty_request_is_the_default_request_in_the_stated_form():
    decoder = Decoder(SetBool.Request, also=SetBool.TYPE, empty=True)
    assert decode(None, None, decoder) == ("json", SetBool.Request())
    assert decode(b"", None, decoder) == ("json", SetBool.Request())
    assert decode(b"", "application/cdr;std_srvs/srv/SetBool", decoder) == ("cdr", SetBool.Request())


def test_a_payload_over_the_limit_is_not_looked_at():
    class Untouchable(Message, package="test_msgs"):
        @classmethod
        def from_json(cls, buffer):
            raise AssertionError("decoded")

        from_cdr = from_json

    with pytest.raises(PayloadError, match="the payload has 101 bytes; at most 100 are accepted"):
        decode(b"{" * 101, None, Decoder(Untouchable, Limits(payload=100, json=6400)))
    with pytest.raises(AssertionError, match="decoded"):
        decode(b"{" * 100, None, Decoder(Untouchable, Limits(payload=100, json=6400)))


def test_json_that_takes_long_to_decode_is_refused_but_the_same_in_cdr_is_not():
    decoder = Decoder(ApplyExternalWrench.Request)
    assert decode(_wrenches(1022), None, decoder)[0] == "json"
    for encoding in (None, "application/json"):
        with pytest.raises(PayloadError) as refused:
            decode(_wrenches(1023), encoding, decoder)
        assert (
            str(refused.value)
            == "the JSON has 1025 objects (counted by '{'); at most 1024 are accepted, send CDR instead"
        )
    many = ApplyExternalWrench.Request.from_json(_wrenches(5000))
    assert decode(many.to_cdr(), None, decoder) == ("cdr", many)


@pytest.mark.parametrize(
    ("payload", "sentence"),
    [
        (
            b'{"data": "%s"}' % (b"x" * 65525),
            "the JSON has 65537 bytes; at most 65536 are accepted (zenoh.max_json_bytes)",
        ),
        (
            b"{%s}" % b",".join([b'"a":1'] * 4097),
            "the JSON has 4097 fields (counted by ':'); at most 4096 are accepted",
        ),
    ],
)
def test_json_over_a_limit_is_refused_before_it_is_decoded(payload, sentence):
    for encoding in (None, "application/json", "text/json"):
        with pytest.raises(PayloadError) as refused:
            decode(payload, encoding)
        assert str(refused.value) == f"{sentence}, send CDR instead"


def test_json_of_exactly_the_limit_is_decoded():
    text = "x" * 65524
    assert decode(b'{"data": "%s"}' % text.encode()) == ("json", String(data=text))


def test_the_limits_of_json_grow_with_the_setting():
    decoder = Decoder(ApplyExternalWrench.Request, Limits(json=1 << 20))
    assert decode(_wrenches(16_382), None, decoder)[0] == "json"
    with pytest.raises(PayloadError, match="at most 16384 are accepted"):
        decode(_wrenches(16_383), None, decoder)


def _wrenches(count):
    return b'{"wrenches": {"external_wrenches": [%s]}}' % b",".join([b"{}"] * count)


def test_encodings_name_the_type_of_cdr():
    assert str(encoding_of("cdr", String)) == "application/cdr;std_msgs/msg/String"
    assert str(encoding_of("cdr", SetBool.Response)) == "application/cdr;std_srvs/srv/SetBool_Response"
    assert str(encoding_of("json", String)) == "application/json"


def test_a_type_name_that_zenoh_cannot_send_is_refused_before_zenoh_panics():
    class Short(Message, package="p" * 240):
        data: string = ""

    Longest = type("L" * 10, (Short,), {"__module__": __name__}, package="p" * 240)  # noqa: N806
    assert len(Longest.TYPE) == 255
    assert str(encoding_of("cdr", Longest)).endswith(f";{Longest.TYPE}")
    TooLong = type("L" * 11, (Short,), {"__module__": __name__}, package="p" * 240)  # noqa: N806
    with pytest.raises(WireError, match="has 256 bytes; Zenoh accepts at most 255"):
        encoding_of("cdr", TooLong)
    assert str(encoding_of("json", TooLong)) == "application/json"


def test_a_refusal_uses_the_fields_of_the_type():
    class Finished(Message, package="test_msgs"):
        success: boolean = True
        status_message: string = ""

    class Named(Message, package="test_msgs"):
        success: string = ""

    assert refusal(SetBool.Response, "no") == SetBool.Response(success=False, message="no")
    assert refusal(Finished, "no") == Finished(success=False, status_message="no")
    assert refusal(Empty.Response, "no") is None
    assert refusal(Named, "no") is None


def test_losses_are_all_counted_and_logged_at_powers_of_ten(caplog):
    rejections = Rejections("topic /x: a sample was refused")
    with caplog.at_level(logging.WARNING):
        for i in range(1, 251):
            rejections.add(f"bad {i}")
    assert rejections.count == 250
    assert caplog.messages == [f"topic /x: a sample was refused ({i} so far): bad {i}" for i in (1, 10, 100)]


def test_a_long_reason_is_cut_in_the_log(caplog):
    Rejections("x").add("y" * 100_000)
    assert len(caplog.messages[0]) < 600
