"""Building messages in Python, and defining message classes."""

import math
import struct
from typing import Annotated, ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field, ValidationError, create_model

from mjplug_schemas import std_msgs
from mjplug_schemas.builtin_interfaces import Duration, Time
from mjplug_schemas.errors import DefinitionError
from mjplug_schemas.geometry_msgs import Pose, Quaternion
from mjplug_schemas.idl import AtMost, float32, float64, int32, sequence, uint8, wstring
from mjplug_schemas.message import Message, Service
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.std_msgs import Bool, Float32, Float64, Int8, String, UInt8MultiArray
from mjplug_schemas.std_srvs import Trigger
from mjplug_schemas.visualization_msgs import Marker

INTEGERS = ["Byte", "Char", "Int8", "Int16", "Int32", "Int64", "UInt8", "UInt16", "UInt32", "UInt64"]


def test_types_are_named_after_their_module_and_class():
    assert String.TYPE == "std_msgs/msg/String"
    assert Trigger.TYPE == "std_srvs/srv/Trigger"
    assert Trigger.Request.TYPE == "std_srvs/srv/Trigger_Request"
    assert Trigger.Response.TYPE == "std_srvs/srv/Trigger_Response"


def test_a_class_elsewhere_names_its_package():
    class Grip(Message, package="my_msgs"):
        OPEN: ClassVar[uint8] = 1

        force: float64 = Field(0.0)

    class Ask(Service, package="my_msgs"):
        class Request(Message):
            pass

        class Response(Message):
            grip: Grip = Field(Grip())

    assert Grip.TYPE == "my_msgs/msg/Grip"
    assert Ask.Response.TYPE == "my_msgs/srv/Ask_Response"
    assert Grip.OPEN == 1
    assert Grip.from_cdr(Grip(force=2).to_cdr()).force == 2.0


def test_initial_values_are_those_of_ros():
    assert Pose().orientation == Quaternion(x=0, y=0, z=0, w=1)
    marker = Marker()
    assert (marker.ns, marker.id, marker.points, marker.texture.data, marker.frame_locked) == ("", 0, (), b"", False)
    assert (marker.color.a, marker.scale.x, marker.pose.orientation.w) == (0.0, 0.0, 1.0)
    assert (Marker.ARROW, Marker.TEXT_VIEW_FACING, Marker.DELETEALL) == (0, 9, 3)


def test_messages_are_frozen_and_hashable():
    message = JointState(name=["a"], position=[1])
    with pytest.raises(ValidationError, match="frozen"):
        message.name = ()
    assert len({message, JointState(name=("a",), position=(1.0,))}) == 1


@pytest.mark.parametrize("name", INTEGERS)
def test_integers_have_the_range_of_their_type(name):
    message = getattr(std_msgs, name)
    bits = int("".join(filter(str.isdigit, name)) or 8)
    low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if name.startswith("Int") else (0, 2**bits - 1)
    assert (message(data=low).data, message(data=high).data) == (low, high)
    for bad in (low - 1, high + 1, 1.0, "1", True, None):
        with pytest.raises(ValidationError, match=f"an integer from {low} to {high}"):
            message(data=bad)


@pytest.mark.parametrize("bad", ["5", True, None, b"5", [1.0], 10**400])
def test_what_is_no_number_is_no_float(bad):
    with pytest.raises(ValidationError, match="must be a float64"):
        Float64(data=bad)


@pytest.mark.parametrize("bad", [1, 0, "true", None])
def test_only_true_and_false_are_bool(bad):
    with pytest.raises(ValidationError, match=r"must be a bool \(true or false\)"):
        Bool(data=bad)


@pytest.mark.parametrize("bad", ["a\0", "\ud800", b"a", 5, None])
def test_only_text_that_fits_the_wire_is_a_string(bad):
    with pytest.raises(ValidationError, match=r"must be a string \(text without NUL or lone surrogates\)"):
        String(data=bad)


def test_unknown_fields_are_refused():
    with pytest.raises(ValidationError, match="dat\n"):
        String(dat="x")


def test_numpy_values_are_taken_as_what_they_are():
    message = JointState(position=np.arange(3.0), velocity=np.arange(2), effort=np.zeros(2, np.float32))
    assert message == JointState(position=[0, 1, 2], velocity=[0, 1], effort=[0, 0])
    assert type(message.velocity[0]) is float
    assert Int8(data=np.int64(-3)) == Int8(data=-3)
    assert type(Float64(data=np.float32(0.5)).data) is float
    assert Bool(data=np.bool_(True)) == Bool(data=True)
    assert UInt8MultiArray(data=np.arange(3, dtype=np.uint8)).data == b"\0\1\2"
    with pytest.raises(ValidationError, match="an integer from -128 to 127"):
        Int8(data=np.int64(300))
    with pytest.raises(ValidationError, match="must be a float64"):
        Float64(data=np.array([1.0]))
    with pytest.raises(ValidationError, match=r"but element 0 is 1\.0"):
        UInt8MultiArray(data=np.ones(1))


@given(value=st.floats(allow_nan=False))
def test_float32_is_rounded_or_refused_alike_alone_and_in_a_sequence(value):
    expected = np.float32(value) if abs(value) < 3.4028235677973366e38 or math.isinf(value) else None
    if expected is None:
        with pytest.raises(ValidationError, match=r"no larger than 3\.4028235e38"):
            Float32(data=value)
        with pytest.raises(ValidationError, match="but element 1 is"):
            std_msgs.Float32MultiArray(data=[0, value])
    else:
        assert Float32(data=value).data == expected
        assert std_msgs.Float32MultiArray(data=[0, value]).data == (0.0, float(expected))
        assert Float32.from_cdr(Float32(data=value).to_cdr()) == Float32(data=value)


@given(ns=st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1))
def test_times_and_durations_are_exact_in_nanoseconds(ns):
    for message in (Time, Duration):
        value = message.from_ns(ns)
        assert value.to_ns() == ns
        assert 0 <= value.nanosec < 10**9


def test_a_negative_duration_counts_its_nanoseconds_upwards():
    assert Duration.from_ns(-1) == Duration(sec=-1, nanosec=999_999_999)
    assert Duration.from_ns(-1_500_000_000) == Duration(sec=-2, nanosec=500_000_000)


@pytest.mark.parametrize(
    ("annotation", "default", "sentence"),
    [
        (float64, ..., "Bad.x needs a default value, because every ROS field has one"),
        (float, 0.0, "Bad.x has the annotation <class 'float'>, which has no ROS type; use types of "
                     "mjplug_schemas.idl, other messages, or sequences of them"),
        (dict[str, float64], {}, "which has no ROS type"),
        (sequence[list[float64]], (), "which has no ROS type"),
        (float64, "0", "Bad.x has the default '0', but it must be a float64 (a number)"),
        (sequence[int32], [], "Bad.x has the default []; write ()"),
        (float32, 0.1, "Bad.x has the default 0.1; write 0.10000000149011612"),
        (Annotated[wstring, AtMost(3)], "", "Bad.x: only strings and sequences can have a bound"),
    ],
)  # fmt: skip
def test_a_field_that_ros_could_not_have_is_refused_where_it_is_defined(annotation, default, sentence):
    with pytest.raises(DefinitionError) as caught:
        create_model("Bad", __base__=Message, x=(annotation, default))
    assert sentence in str(caught.value)


def test_a_service_needs_both_messages():
    with pytest.raises(DefinitionError, match="half/srv/Half needs a nested class `Response` that is a Message"):

        class Half(Service, package="half"):
            class Request(Message):
                pass


def test_float32_limits_are_those_of_ieee():
    largest = struct.unpack("<f", struct.pack("<I", 0x7F7FFFFF))[0]
    assert Float32(data=largest).data == largest
