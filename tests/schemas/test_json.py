"""JSON both ways, and the sentence for each common mistake."""

import json
import math
from typing import Annotated

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import Field

from mjplug_schemas.errors import CodecError
from mjplug_schemas.geometry_msgs import AccelWithCovariance
from mjplug_schemas.idl import AtMost, sequence, string, uint8, uint8_sequence
from mjplug_schemas.message import Message
from mjplug_schemas.mujoco_ros2_control_msgs import ApplyExternalWrench, FreeJointStateArray, SetPause
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.std_msgs import Bool, Empty, Float32, Float32MultiArray, Float64, Header, Int64, String, UInt8
from mjplug_schemas.std_msgs import UInt8MultiArray as Octets


class Bounded(Message, package="probe"):
    name: Annotated[string, AtMost(5)] = Field("")
    few: Annotated[sequence[uint8], AtMost(3)] = Field(())
    data: Annotated[uint8_sequence, AtMost(2)] = Field(b"")


@given(data=st.data())
@settings(max_examples=8)
def test_every_message_survives_json(message, data, messages, same):
    original = data.draw(messages(message))
    text = original.to_json()
    assert same(message.from_json(text), original)
    assert list(json.loads(text)) == list(message.model_fields)


def test_json_is_read_from_text_and_from_any_bytes():
    for buffer in ('{"data": "x"}', b'{"data": "x"}', bytearray(b'{"data": "x"}'), memoryview(b'{"data": "x"}')):
        assert String.from_json(buffer) == String(data="x")


def no_constant(text):
    raise AssertionError(f"{text} is no JSON")


def test_nan_and_infinities_are_texts_so_that_every_parser_reads_them():
    original = JointState(position=[math.nan, math.inf, -math.inf, 1.5])
    text = original.to_json()
    assert json.loads(text, parse_constant=no_constant)["position"] == ["NaN", "Infinity", "-Infinity", 1.5]
    decoded = JointState.from_json(text)
    assert math.isnan(decoded.position[0])
    assert decoded.position[1:] == (math.inf, -math.inf, 1.5)


@pytest.mark.parametrize("message_type", [Float32, Float64])
@pytest.mark.parametrize(("text", "value"), [("Infinity", math.inf), ("-Infinity", -math.inf), ("NaN", math.nan)])
def test_nan_and_infinities_are_read_as_texts_and_as_python_writes_them(message_type, text, value):
    for written in (f'"{text}"', text):
        assert str(message_type.from_json(f'{{"data": {written}}}').data) == str(value)
    scan = Float32MultiArray.from_json(f'{{"data": [1, "{text}"]}}')
    assert str(scan.data) == str((1.0, value))
    assert f'"data":[1.0,"{text}"]'.encode() in scan.to_json()


@pytest.mark.parametrize("text", ["inf", "nan", "infinity", "+Infinity", "1.5", ""])
def test_no_other_text_is_a_number(text):
    with pytest.raises(CodecError, match="data must be a float64"):
        Float64.from_json(f'{{"data": "{text}"}}')


def test_in_python_no_text_is_a_number():
    with pytest.raises(ValueError, match="must be a float64"):
        Float64(data="Infinity")


def test_fields_left_out_have_ros_initial_values():
    assert ApplyExternalWrench.Request.from_json(b"{}") == ApplyExternalWrench.Request()
    wrench = ApplyExternalWrench.Request.from_json(b'{"wrenches": {"external_wrenches": [{}]}}')
    assert wrench.wrenches.external_wrenches[0].duration.sec == 0


def test_bytes_are_base64_of_the_alphabet_that_browsers_take():
    assert Octets(data=b"\xfb\xff\xbf").to_json() == b'{"layout":{"dim":[],"data_offset":0},"data":"+/+/"}'


@pytest.mark.parametrize("text", ['"+/+/AQ=="', '"-_-_AQ=="', '"-_-_AQ"', "[251, 255, 191, 1]"])
def test_bytes_are_read_from_either_base64_alphabet_or_a_list(text):
    assert Octets.from_json(f'{{"data": {text}}}').data == b"\xfb\xff\xbf\1"


def test_integers_are_taken_for_floats():
    assert Float64.from_json(b'{"data": 5}') == Float64(data=5.0)
    assert type(Float64(data=5).data) is float


SAMPLES = [
    (SetPause.Request, b'{"paused": "yes"}', 'paused must be a bool (true or false), got "yes"'),
    (SetPause.Request, b'{"pausd": true}', "unknown field 'pausd', did you mean 'paused'?; known: paused"),
    (SetPause.Request, b'{"paused": null, "zz": 1}',
     "paused must be a bool (true or false), got null; unknown field 'zz'; known: paused"),
    (Empty, b'{"data": 1}', "unknown field 'data'; the type has no fields"),
    (SetPause.Request, b"", "not valid JSON: the text is empty"),
    (SetPause.Request, b"pause!", "not valid JSON: expected value at line 1 column 1"),
    (SetPause.Request, b'{"paused": true', "not valid JSON: EOF while parsing an object at line 1 column 15"),
    (SetPause.Request, b"true", "the message must be an object, got true"),
    (SetPause.Request, b"[]", "the message must be an object, got a list of 0"),
    (Bool, b'{"data": 1}', "data must be a bool (true or false), got 1"),
    (String, b'{"data": 5}', "data must be a string (text without NUL or lone surrogates), got 5"),
    (String, b'{"data": "a\\u0000b"}',
     'data must be a string (text without NUL or lone surrogates), got "a\\u0000b"'),
    (UInt8, b'{"data": 256}', "data must be a uint8 (an integer from 0 to 255), got 256"),
    (UInt8, b'{"data": 1.0}', "data must be a uint8 (an integer from 0 to 255), got 1.0"),
    (Int64, b'{"data": 9223372036854775808}', "data must be an int64 (an integer from -9223372036854775808 to "
                                              "9223372036854775807), got 9223372036854775808"),
    (Float64, b'{"data": "5"}', 'data must be a float64 (a number), got "5"'),
    (Float64, b'{"data": true}', "data must be a float64 (a number), got true"),
    (Float64, b'{"data": {"x": 1}}', "data must be a float64 (a number), got an object"),
    (Float32, b'{"data": 1e39}', "data must be a float32 (a number no larger than 3.4028235e38), got 1e+39"),
    (Float32MultiArray, b'{"data": [1, -1e39]}',
     "data must contain numbers no larger than 3.4028235e38, but element 1 is -1e+39"),
    (JointState, b'{"position": [1, 2, "x", "y"]}', 'position[2] must be a float64 (a number), got "x"'),
    (JointState, b'{"position": 5}', "position must be a list, got 5"),
    (JointState, b'{"header": {"stamp": [1, 2]}}', "header.stamp must be an object, got a list of 2"),
    (JointState, b'{"header": {"stamp": {"secs": 1}}}',
     "unknown field 'header.stamp.secs', did you mean 'sec'?; known: sec, nanosec"),
    (ApplyExternalWrench.Request, b'{"wrenches": {"external_wrenches": [{}, {"wrench": {"frame": "x"}}]}}',
     "unknown field 'wrenches.external_wrenches[1].wrench.frame'; known: header, wrench"),
    (AccelWithCovariance, b'{"covariance": [1, 2]}', "covariance must have exactly 36 elements, not 2"),
    (Octets, b'{"data": "!"}',
     'data must be base64 text or a list of uint8 values (integers from 0 to 255), got "!"'),
    (Octets, b'{"data": [1, 256]}', "data must contain integers from 0 to 255, but element 1 is 256"),
    (Octets, b'{"data": [true]}', "data must contain integers from 0 to 255, but element 0 is True"),
    (Bounded, '{"name": "ééé"}'.encode(), "name must have at most 5 bytes of UTF-8, not 6"),
    (Bounded, b'{"few": [1, 2, 3, 4]}', "few must have at most 3 elements, not 4"),
    (Bounded, b'{"data": [1, 2, 3]}', "data must have at most 2 elements, not 3"),
]  # fmt: skip


@pytest.mark.parametrize(("message_type", "text", "sentence"), SAMPLES)
def test_mistakes_are_explained(message_type, text, sentence):
    with pytest.raises(CodecError) as caught:
        message_type.from_json(text)
    assert str(caught.value) == f"{message_type.TYPE}: {sentence}"


def test_many_errors_are_summed_up():
    text = json.dumps({f"x{i}": 0 for i in range(9)})
    with pytest.raises(CodecError) as caught:
        Bool.from_json(text)
    known = [f"unknown field 'x{i}'; known: data" for i in range(5)]
    assert str(caught.value) == f"std_msgs/msg/Bool: {'; '.join(known)}; and 4 more errors"


@pytest.mark.parametrize(
    "text",
    [
        b"x" * 1_000_000,
        b"[" * 1_000_000,
        b'{"a":' * 200_000,
        b'{"' + b"a" * 1_000_000 + b'": 1}',
        b'{"free_joints": "' + b"a" * 1_000_000 + b'"}',
        b'{"free_joints": [' + b"5," * 500_000 + b"5]}",
        b'{"free_joints": [' + b'{"a":1},' * 100_000 + b"5]}",
        json.dumps({f"a{i}": 0 for i in range(100_000)}).encode(),
        json.dumps({"free_joints": [{f"a{i}": 0 for i in range(100_000)}]}).encode(),
        b'{"free_joints": ' + b"9" * 4000 + b"}",
        bytes(range(256)) * 4000,
    ],
    ids=lambda text: text[:20].decode("latin-1").encode("unicode_escape").decode(),
)
def test_a_flood_of_garbage_gets_a_short_answer(text):
    with pytest.raises(CodecError) as caught:
        FreeJointStateArray.from_json(text)
    assert len(str(caught.value)) < 1000


@given(text=st.text(max_size=40) | st.binary(max_size=40))
def test_random_text_is_refused_or_is_the_message(text):
    try:
        message = Header.from_json(text)
    except CodecError:
        return
    assert Header.from_json(message.to_json()) == message


def test_every_type_has_a_json_schema_with_all_its_fields(message):
    schema = message.model_json_schema()
    assert list(schema.get("properties", {})) == list(message.model_fields)
    assert schema["additionalProperties"] is False
    for field in schema.get("properties", {}).values():
        assert {"type", "$ref", "anyOf"} & field.keys()


NUMBER = {"anyOf": [{"type": "number"}, {"enum": ["NaN", "Infinity", "-Infinity"], "type": "string"}]}


def test_the_json_schema_contains_ranges_bounds_and_units():
    assert Header.model_json_schema()["$defs"]["Time"]["properties"]["sec"] == {
        "default": 0,
        "description": "Whole seconds since the clock's origin, rounded down [s].",
        "maximum": 2147483647,
        "minimum": -2147483648,
        "title": "Sec",
        "type": "integer",
    }
    bounded = Bounded.model_json_schema()["properties"]
    assert (bounded["name"]["maxLength"], bounded["few"]["maxItems"]) == (5, 3)
    covariance = AccelWithCovariance.model_json_schema()["properties"]["covariance"]
    assert (covariance["minItems"], covariance["maxItems"], covariance["items"]) == (36, 36, NUMBER)
