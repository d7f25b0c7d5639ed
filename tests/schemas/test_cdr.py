"""CDR against Fast-CDR's own bytes and against rosbags, and every kind of bad input."""

import json
import struct
import sys
from itertools import count
from pathlib import Path
from typing import Annotated, get_args

import pytest
from cdr_probes import Blanks, Bounded, ByteBytesDouble, BytesFlag, DoublesByte, DoublesDouble, Flags, PointFields, Wide
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import create_model

from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.cdr import encode_with_layout
from mjplug_schemas.errors import CodecError
from mjplug_schemas.geometry_msgs import Point, PoseWithCovariance
from mjplug_schemas.idl import (
    AtMost,
    Exactly,
    Primitive,
    boolean,
    byte,
    byte_sequence,
    char,
    char_sequence,
    float32,
    float64,
    int8,
    int16,
    int32,
    int64,
    sequence,
    string,
    uint8,
    uint8_sequence,
    uint16,
    uint32,
    uint64,
)
from mjplug_schemas.message import Message
from mjplug_schemas.mjplug_msgs import Sample, Step
from mjplug_schemas.mujoco_ros2_control_msgs import FreeJointStateArray
from mjplug_schemas.sensor_msgs import JointState, PointField
from mjplug_schemas.shape import fields
from mjplug_schemas.std_msgs import ColorRGBA, Empty, Header, MultiArrayLayout, String
from mjplug_schemas.std_srvs import Trigger

VECTORS = json.loads((Path(__file__).parent / "vectors" / "cdr_fastcdr.json").read_text())


SAMPLES = {
    "std_msgs/msg/Empty {}": Empty(),
    "std_msgs/msg/String {data: 'é'}": String(data="é"),
    "std_srvs/srv/Trigger_Response {success: true, message: 'hi'}": Trigger.Response(success=True, message="hi"),
    "{float64[] a = [], uint8 b = 7}": DoublesByte(b=7),
    "{float64[] a = [], float64 b = 7.0}": DoublesDouble(b=7),
    "{bool[] a = [true], float64 b = 1.0, bool[3] c = [true,false,true]}": Flags(a=[True], b=1, c=[True, False, True]),
    "sensor_msgs/msg/JointState {stamp: 1 s 2 ns, frame_id: 'a', name: ['a'], position: [1.0], velocity: [], "
    "effort: []}": JointState(header=Header(stamp=Time(sec=1, nanosec=2), frame_id="a"), name=["a"], position=[1.0]),
    "sensor_msgs/msg/JointState {stamp: 1 s 2 ns, frame_id: 'a', name: ['a'], position: [], velocity: [2.0], "
    "effort: []}": JointState(header=Header(stamp=Time(sec=1, nanosec=2), frame_id="a"), name=["a"], velocity=[2.0]),
    "{uint8[] a = [5], bool b = true}": BytesFlag(a=[5], b=True),
    "{uint8 a = 1, uint8[] b = [5], float64 c = 2.5}": ByteBytesDouble(a=1, b=b"\5", c=2.5),
    "sensor_msgs/msg/PointField[] p = [{'x',1,7,1},{'yy',4,7,1}], bool b = false": PointFields(
        p=[
            PointField(name="x", offset=1, datatype=7, count=1),
            PointField(name="yy", offset=4, datatype=7, count=1),
        ]
    ),
}


@pytest.mark.parametrize("name", [name for name in VECTORS if not name.startswith("_")])
def test_bytes_are_those_of_fast_cdr(name):
    message = SAMPLES[name]
    assert message.to_cdr().hex() == VECTORS[name]
    assert type(message).from_cdr(bytes.fromhex(VECTORS[name])) == message


@given(data=st.data())
@settings(max_examples=15)
def test_every_message_agrees_with_rosbags_byte_for_byte_both_ways(message, data, messages, rosbags, same):
    original = data.draw(messages(message))
    encoded = original.to_cdr()
    assert encoded == rosbags.encode(original)
    assert same(message.from_cdr(encoded), original)
    assert same(rosbags.decode(message, encoded), original)


@given(data=st.data())
@settings(max_examples=5)
def test_big_endian_input_is_read(message, data, messages, rosbags, same):
    original = data.draw(messages(message))
    encoded = rosbags.encode(original, little_endian=False)
    assert encoded[:2] == b"\0\0"
    assert same(message.from_cdr(encoded), original)


@given(data=st.data())
@settings(max_examples=4)
def test_a_message_cut_anywhere_is_refused(message, data, messages):
    encoded = data.draw(messages(message)).to_cdr()
    for end in range(len(encoded)):
        with pytest.raises(CodecError):
            message.from_cdr(encoded[:end])


@given(header=st.sampled_from([b"\0\1\0\0", b"\0\0\0\0"]), body=st.binary(max_size=120))
@settings(max_examples=8)
def test_garbage_is_refused_or_is_a_valid_message(message, header, body, same):
    check_refused_or_valid(message, header + body, same)


@given(data=st.data())
@settings(max_examples=8)
def test_a_message_with_changed_bytes_is_refused_or_valid(message, data, messages, same):
    damaged = bytearray(data.draw(messages(message)).to_cdr())
    for _ in range(data.draw(st.integers(1, 3))):
        damaged[data.draw(st.integers(4, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    check_refused_or_valid(message, bytes(damaged), same)


def check_refused_or_valid(message, buffer, same):
    """Decoding must accept the same values as the constructor."""
    try:
        decoded = message.from_cdr(buffer)
    except CodecError:
        return
    assert same(message.model_validate(decoded.model_dump()), decoded)
    assert same(message.from_cdr(decoded.to_cdr()), decoded)


ELEMENTS = [boolean, byte, char, int8, uint8, int16, uint16, int32, uint32, int64, uint64, float32, float64, string]
ELEMENTS += [Time, Point, ColorRGBA, Header, Empty, MultiArrayLayout, PoseWithCovariance]
OCTETS = {byte: byte_sequence, char: char_sequence, uint8: uint8_sequence}


NUMBERS = count()


@st.composite
def types(draw):
    """Random message types: any fields in any order, so that every alignment comes up."""
    members = {}
    for i, element in enumerate(draw(st.lists(st.sampled_from(ELEMENTS), min_size=1, max_size=7))):
        zero = element() if isinstance(element, type) else get_args(element)[0]()
        many, none = (OCTETS[element], b"") if element in OCTETS else (sequence[element], ())
        three = bytes(3) if element in OCTETS else (zero,) * 3
        members[f"f{i}"] = draw(
            st.sampled_from(
                [
                    (element, zero),
                    (element, zero),
                    (many, none),
                    (Annotated[many, AtMost(2)], none),
                    (Annotated[many, Exactly(3)], three),
                ]
            )
        )
    return create_model(f"Random{next(NUMBERS)}", __base__=Message, __cls_kwargs__={"package": "probe"}, **members)


@given(data=st.data())
@settings(max_examples=100)
def test_random_types_agree_with_rosbags(data, messages, rosbags, same):
    message = data.draw(types())
    rosbags.add(message)
    for _ in range(3):
        original = data.draw(messages(message))
        encoded = original.to_cdr()
        assert encoded == rosbags.encode(original)
        assert same(message.from_cdr(encoded), original)
        assert same(message.from_cdr(rosbags.encode(original, little_endian=False)), original)


@given(data=st.data())
def test_bounded_messages_agree_with_rosbags(data, messages, rosbags, same):
    rosbags.add(Bounded)
    original = data.draw(messages(Bounded))
    assert original.to_cdr() == rosbags.encode(original)
    assert same(Bounded.from_cdr(original.to_cdr()), original)


@given(data=st.data())
def test_messages_without_fields_agree_with_rosbags_inside_others(data, messages, rosbags, same):
    rosbags.add(Blanks)
    original = data.draw(messages(Blanks))
    assert original.to_cdr() == rosbags.encode(original)
    assert same(Blanks.from_cdr(original.to_cdr()), original)


def test_a_wide_string_is_a_count_of_utf16_units_without_nul():
    message = Wide(flag=True, text="a€😀", texts=["", "b"])
    units = "a€😀".encode("utf-16-le")
    assert len(units) == 8
    body = struct.pack("<B3xI8sIII2s", 1, 4, units, 2, 0, 1, b"b\0")
    assert message.to_cdr() == b"\0\1\0\0" + body
    assert Wide.from_cdr(message.to_cdr()) == message
    assert Wide.from_cdr(b"\0\0\0\0" + struct.pack(">B3xI2sxxI", 1, 1, b"\0a", 0)) == Wide(flag=True, text="a")


@given(data=st.data())
@settings(max_examples=8)
def test_the_layout_leads_to_every_value(message, data, messages):
    original = data.draw(messages(message))
    buffer, layout = encode_with_layout(original)
    assert bytes(buffer) == original.to_cdr()
    for path, span in layout.items():
        check_span(buffer, span, eval(f"it.{path}", {"it": original}))
    assert leaves(original) == len(layout)


def check_span(buffer, span, value):
    if span.primitive == "string":
        assert bytes(buffer[span.offset : span.offset + span.count]).decode() == value
        return
    code = {"bool": "?", "byte": "B", "char": "B", "float32": "f", "float64": "d"}.get(span.primitive)
    code = code or {8: "b", 16: "h", 32: "i", 64: "q"}[int(span.primitive.lstrip("uint"))]
    code = code.upper() if span.primitive.startswith("u") else code
    found = struct.unpack_from(f"<{span.count}{code}", buffer, span.offset)
    expected = tuple(value) if isinstance(value, tuple | bytes) else (value,)
    assert struct.pack(f"<{span.count}{code}", *expected) == struct.pack(f"<{span.count}{code}", *found)


def leaves(message):
    """How many values a message has, a sequence or array of numbers being one."""
    total = 0
    for field in fields(type(message)):
        value = getattr(message, field.name)
        for element in [value] if field.kind == "one" else value:
            if isinstance(element, Message):
                total += leaves(element)
            elif isinstance(element, str) or field.kind == "one":
                total += 1
        if field.kind != "one" and isinstance(field.element, Primitive) and field.element.size:
            total += 1
    return total


def test_layout_of_a_message_is_as_documented():
    buffer, layout = encode_with_layout(FreeJointStateArray(free_joints=[{"name": "ab"}, {"name": "c"}]))
    assert layout["header.stamp.sec"].offset == 4
    assert layout["header.stamp.sec"].primitive == "int32"
    assert (layout["free_joints[1].name"].count, layout["free_joints[1].name"].primitive) == (1, "string")
    x = layout["free_joints[1].pose.pose.position.x"]
    struct.pack_into("<d", buffer, x.offset, 2.5)
    assert FreeJointStateArray.from_cdr(buffer).free_joints[1].pose.pose.position.x == 2.5


def test_a_decoded_message_is_like_a_constructed_one():
    constructed = JointState(name=["a"], position=[1.0])
    decoded = JointState.from_cdr(constructed.to_cdr())
    assert decoded == constructed
    assert hash(decoded) == hash(constructed)
    assert repr(decoded) == repr(constructed)
    assert decoded.model_dump() == constructed.model_dump()
    assert decoded.model_copy(update={"name": ("b",)}) == JointState(name=["b"], position=[1.0])


def test_packed_messages_with_equal_ends_differ_in_their_numbers_only():
    def request(steps, ctrl, *observe):
        return Step.Request(steps=steps, ctrl=ctrl, observe=observe, inputs=[Sample(topic="/a", cdr=b"abc")])

    for i in range(200):
        # The end is at another alignment if the number of controls is odd, and there are more ends than are kept.
        expected = request(i, [float(i)] * (i % 3), "qpos", f"a{i % 90}")
        read = Step.Request.from_cdr(expected.to_cdr(), packed=True)
        assert read == expected.model_copy(update={"ctrl": read.ctrl})
        assert list(read.ctrl) == list(expected.ctrl)


def test_kept_ends_of_packed_messages_do_not_keep_the_messages_in_memory():
    sources = [
        Step.Response(observations=[0.0] * 1000, widths=[1000], outputs=[Sample(cdr=bytes([i]))]).to_cdr()
        for i in range(20)
    ]
    before = [sys.getrefcount(source) for source in sources]
    assert all(list(Step.Response.from_cdr(source, packed=True).widths) == [1000] for source in sources)
    assert [sys.getrefcount(source) for source in sources] == before


def test_an_invalid_end_of_a_packed_message_is_refused_each_time():
    good = Step.Request(ctrl=[1.0], observe=["qpos"]).to_cdr()
    for _ in range(2):
        Step.Request.from_cdr(good, packed=True)
        with pytest.raises(CodecError, match="observe"):
            Step.Request.from_cdr(good.replace(b"qpos\0", b"qposx"), packed=True)
        with pytest.raises(CodecError, match="more bytes follow"):
            Step.Request.from_cdr(good + bytes(8), packed=True)
        with pytest.raises(CodecError, match="remain"):
            Step.Request.from_cdr(good[:-2], packed=True)
