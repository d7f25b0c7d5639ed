"""Invalid CDR that is refused, the error messages, and valid CDR."""

import pytest
from cdr_probes import Bounded, BytesFlag, Flags

from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.errors import CodecError
from mjplug_schemas.mujoco_ros2_control_msgs import FreeJointStateArray
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.std_msgs import Bool, Empty, Float32, Header, Int32, String
from mjplug_schemas.visualization_msgs import MarkerArray


@pytest.mark.parametrize(
    ("message_type", "hexadecimal", "sentence"),
    [
        (String, "", "std_msgs/msg/String: expected a 4-byte CDR header that starts with 00 00 or 00 01, "
                     "got no bytes at all"),
        (String, "0001", "std_msgs/msg/String: expected a 4-byte CDR header that starts with 00 00 or 00 01, "
                         "got 00 01"),
        (String, "7b7d0000", "std_msgs/msg/String: expected a 4-byte CDR header that starts with 00 00 or 00 01, "
                             "got 7b 7d 00 00"),
        (Empty, "00010000", "std_msgs/msg/Empty: at byte 4: expected the zero byte of an empty message, "
                            "1 byte or more, but 0 bytes remain"),
        (Int32, "00010000 0102", "std_msgs/msg/Int32: data at byte 4: expected int32, 4 bytes or more, "
                                 "but 2 bytes remain"),
        (Bool, "00010000 02", "std_msgs/msg/Bool: data at byte 4: expected a bool (0 or 1), got 2"),
        (Bool, "00010000 01 00000000", "std_msgs/msg/Bool: the message ends at byte 5, but 4 more bytes follow"),
        (String, "00010000 0300", "std_msgs/msg/String: data at byte 4: expected the length of a string, "
                                  "4 bytes or more, but 2 bytes remain"),
        (String, "00010000 ffffffff 6100", "std_msgs/msg/String: data at byte 8: expected a string of length "
                                           "4294967295, 4294967295 bytes or more, but 2 bytes remain"),
        (String, "00010000 02000000 6161", "std_msgs/msg/String: data at byte 9: expected a string that ends with NUL"),
        (String, "00010000 03000000 61ff00", "std_msgs/msg/String: data at byte 9: expected UTF-8, got ff"),
        (String, "00010000 04000000 61006200", "std_msgs/msg/String: data at byte 8: "
                                               "expected a string without NUL"),
        (JointState, "00010000 0000000000000000 01000000 00000000 ffffff7f",
         "sensor_msgs/msg/JointState: name at byte 24: expected 2147483647 strings, 8589934588 bytes or more, "
         "but 0 bytes remain"),
        (JointState, "00010000 0000000000000000 01000000 00000000 02000000 020000006100 0000 020000006161",
         "sensor_msgs/msg/JointState: name[1] at byte 37: expected a string that ends with NUL"),
        (JointState, "00010000 0000000000000000 01000000 00000000 00000000 ffffffff",
         "sensor_msgs/msg/JointState: position at byte 28: expected 4294967295 float64 values, "
         "34359738360 bytes or more, but 0 bytes remain"),
        (MarkerArray, "00010000 ffffffff", "visualization_msgs/msg/MarkerArray: markers at byte 8: "
                                           "expected 4294967295 elements, 798863916870 bytes or more, "
                                           "but 0 bytes remain"),
        (FreeJointStateArray, "00010000 0000000000000000 01000000 00000000 01000000 03000000 6100" + "00" * 150,
         "mujoco_ros2_control_msgs/msg/FreeJointStateArray: free_joints[0].name at byte 28: "
         "expected a string without NUL"),
        (BytesFlag, "00010000 05000000 0102", f"{BytesFlag.TYPE}: a at byte 8: expected 5 bytes, 5 bytes or more, "
                                              "but 2 bytes remain"),
        (Flags, "00010000 02000000 0103" + "00" * 20, f"{Flags.TYPE}: a[1] at byte 9: expected a bool (0 or 1), got 3"),
        (Bounded, "00010000 07000000 616161616161 00", "probe/msg/Bounded: name at byte 8: "
                                                      "expected at most 5 bytes of UTF-8, got 6"),
        (Bounded, "00010000 01000000 00000000 04000000" + "00" * 90,
         "probe/msg/Bounded: few at byte 12: expected at most 3 elements, got 4"),
    ],
)  # fmt: skip
def test_bad_bytes_are_explained(message_type, hexadecimal, sentence):
    with pytest.raises(CodecError) as caught:
        message_type.from_cdr(bytes.fromhex(hexadecimal))
    assert str(caught.value) == sentence


@pytest.mark.parametrize(
    ("bad", "sentence"),
    [
        (Int32.model_construct(data=2**31), "std_msgs/msg/Int32: data: 2147483648 is not of type int32"),
        (Int32.model_construct(data="5"), "std_msgs/msg/Int32: data: '5' is not of type int32"),
        (Float32.model_construct(data=1e39), "std_msgs/msg/Float32: data: 1e+39 is not of type float32"),
        (Header.model_construct(stamp=Time.model_construct(sec=0, nanosec=-1), frame_id=""),
         "std_msgs/msg/Header: stamp.nanosec: -1 is not of type uint32"),
        (String.model_construct(data="a\0b"),
         "std_msgs/msg/String: data: 'a\\x00b' contains NUL, which terminates a string"),
        (String.model_construct(data="\ud800"),
         "std_msgs/msg/String: data: '\\ud800' contains lone surrogates, which cannot be encoded"),
        (JointState.model_construct(header=Header(), name=("a", "b\0")),
         "sensor_msgs/msg/JointState: name[1]: 'b\\x00' contains NUL, which terminates a string"),
        (JointState.model_construct(header=Header(), name=(), position=(1.0, "x")),
         "sensor_msgs/msg/JointState: position: not all elements are of type float64: "
         "required argument is not a float"),
        (Bounded.model_construct(name="sixsix"), "probe/msg/Bounded: name: expected at most 5 bytes of UTF-8, got 6"),
        (Bounded.model_construct(name="", few=(1, 2, 3, 4)),
         "probe/msg/Bounded: few: expected at most 3 elements, got 4"),
        (Bounded.model_construct(name="", few=(), names=(), points=(), data=b"", times=()),
         "probe/msg/Bounded: times: expected 2 elements, got 0"),
        (String.model_construct(data=5),
         "std_msgs/msg/String: a value that was not validated does not fit its type: "
         "'int' object has no attribute 'encode'"),
    ],
)  # fmt: skip
def test_values_that_escaped_validation_are_not_written(bad, sentence):
    with pytest.raises(CodecError) as caught:
        bad.to_cdr()
    assert str(caught.value) == sentence


def test_up_to_three_bytes_of_padding_may_follow():
    for padding in range(4):
        assert Bool.from_cdr(b"\0\1\0\0\1" + bytes(padding)) == Bool(data=True)


def test_a_string_of_length_zero_is_empty_as_fast_cdr_reads_it():
    assert String.from_cdr(bytes.fromhex("0001000000000000")) == String()
    named = bytes.fromhex(
        "00010000 0000000000000000 01000000 00000000 02000000 00000000 02000000 6100 0000" + "00" * 12
    )
    assert JointState.from_cdr(named) == JointState(name=["", "a"])


def test_any_bytes_like_object_is_read():
    encoded = String(data="x").to_cdr()
    for buffer in (encoded, bytearray(encoded), memoryview(encoded)):
        assert String.from_cdr(buffer) == String(data="x")
    with pytest.raises(TypeError):
        String.from_cdr(5)
