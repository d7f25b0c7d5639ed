"""Frames must be, byte for byte, what the message itself encodes to."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mjplug.contracts.cdr_frame import CdrFrame
from mjplug.errors import UnknownName
from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.geometry_msgs import Point, Pose, PoseStamped, Quaternion
from mjplug_schemas.mjplug_msgs import Step
from mjplug_schemas.mujoco_ros2_control_msgs import FreeJointState, FreeJointStateArray
from mjplug_schemas.sensor_msgs import Image, JointState, PointCloud2, PointField
from mjplug_schemas.std_msgs import Bool, Float32MultiArray, Header, String

TEXT = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=12)
NUMBER = st.floats(allow_nan=False)
STAMP = st.integers(-(2**31) * 10**9, (2**31) * 10**9 - 1)


@given(st.lists(st.tuples(TEXT, NUMBER, NUMBER, NUMBER), max_size=8), TEXT, STAMP)
def test_a_joint_state_frame_equals_the_encoded_message(joints, frame_id, time_ns):
    names = tuple(name for name, *_ in joints)
    zeros = (0.0,) * len(joints)
    frame = CdrFrame(
        JointState(header=Header(frame_id=frame_id), name=names, position=zeros, velocity=zeros, effort=zeros)
    )
    columns = {
        field: tuple(joint[i] for joint in joints) for i, field in enumerate(("position", "velocity", "effort"), 1)
    }
    for field, values in columns.items():
        frame.view(field)[:] = values
    frame.set_stamp("header.stamp", time_ns)

    stamp = Time(sec=time_ns // 10**9, nanosec=time_ns % 10**9)
    expected = JointState(header=Header(stamp=stamp, frame_id=frame_id), name=names, **columns)
    assert frame.payload() == expected.to_cdr()
    assert JointState.from_cdr(frame.payload()) == expected


@given(st.lists(st.tuples(TEXT, *[NUMBER] * 3), min_size=1, max_size=5))
def test_slots_write_numbers_that_lie_between_texts(bodies):
    frame = CdrFrame(FreeJointStateArray(free_joints=tuple(FreeJointState(name=name) for name, *_ in bodies)))
    slots = frame.slots(f"free_joints[{i}].pose.pose.position" for i in range(len(bodies)))
    assert len(slots) == 3 * len(bodies)
    slots.write(np.array([numbers for _, *numbers in bodies]).ravel())

    expected = FreeJointStateArray(
        free_joints=tuple(
            FreeJointState(name=name, pose=PoseStamped(pose=Pose(position=Point(x=x, y=y, z=z))))
            for name, x, y, z in bodies
        )
    )
    assert frame.payload() == expected.to_cdr()


def test_slots_of_four_byte_numbers():
    frame = CdrFrame(FreeJointStateArray(free_joints=(FreeJointState(name="a"), FreeJointState(name="bcd"))))
    frame.slots(["header.stamp.sec", "free_joints[1].twist.header.stamp.sec"]).write([7, -8])
    message = FreeJointStateArray.from_cdr(frame.payload())
    assert message.header.stamp == Time(sec=7)
    assert message.free_joints[1].twist.header.stamp == Time(sec=-8)
    assert message.free_joints[0] == FreeJointState(name="a")
    assert len(frame.slots([])) == 0


def test_a_struct_of_numbers_is_one_view():
    frame = CdrFrame(FreeJointStateArray(free_joints=(FreeJointState(name="a"), FreeJointState(name="bcd"))))
    pose = frame.view("free_joints[1].pose.pose")
    pose[:] = [1, 2, 3, 0.5, 0.5, 0.5, 0.5]
    body = FreeJointStateArray.from_cdr(frame.payload()).free_joints[1]
    assert body.pose.pose == Pose(position=Point(x=1, y=2, z=3), orientation=Quaternion(x=0.5, y=0.5, z=0.5, w=0.5))


@pytest.mark.parametrize("length", range(1, 9))
def test_numbers_are_aligned_whatever_the_texts_before_them(length):
    frame = CdrFrame(JointState(header=Header(frame_id="f" * length), name=("n" * length,), position=(1.0,)))
    view = frame.view("position")
    assert view.flags.aligned
    assert view.ctypes.data % 8 == 0
    assert view.tolist() == [1.0]


def test_views_have_the_type_of_the_field():
    frame = CdrFrame(Float32MultiArray(data=(1.5, 2.5)))
    assert frame.view("data").dtype == np.float32
    assert CdrFrame(Bool(data=True)).view("data").tolist() == [True]
    frame = CdrFrame(JointState())
    assert frame.view("header.stamp.nanosec").dtype == np.uint32
    assert frame.view("position").shape == (0,)


@pytest.mark.parametrize("joints", [1, 30, 1000])
def test_numbers_are_aligned_and_the_buffer_is_what_is_sent(joints):
    zeros = [0.0] * joints
    frame = CdrFrame(JointState(name=["j"] * joints, position=zeros, velocity=zeros, effort=zeros))
    position = frame.view("position")
    assert position.flags.aligned
    position[:] = 1.5
    assert bytes(frame.buffer) == frame.payload()
    assert JointState.from_cdr(frame.buffer).position == (1.5,) * joints


def test_a_payload_is_a_copy():
    frame = CdrFrame(JointState(position=(1.0,)))
    before = frame.payload()
    frame.view("position")[0] = 2.0
    assert JointState.from_cdr(before).position == (1.0,)
    assert JointState.from_cdr(frame.payload()).position == (2.0,)


@given(st.integers(0, 2**64 - 1), STAMP, st.integers(0, 2**32 - 1), st.lists(NUMBER, max_size=3), TEXT)
def test_a_writer_writes_adjacent_numbers_of_several_types(step, time_ns, epoch, values, text):
    stamp = divmod(time_ns, 10**9)
    frame = CdrFrame(Step.Response(message=text, observations=values, widths=[len(values)]))
    frame.writer(("step", "stamp", "epoch"))(step, *stamp, epoch)
    expected = Step.Response(
        message=text,
        step=step,
        stamp=Time(sec=stamp[0], nanosec=stamp[1]),
        epoch=epoch,
        observations=values,
        widths=[len(values)],
    )
    assert frame.payload() == expected.to_cdr()


@pytest.mark.parametrize("paths", [("message",), ("epoch", "step"), ("step", "epoch"), ("success", "step")])
def test_a_writer_needs_adjacent_numbers(paths):
    with pytest.raises(TypeError, match=f"{', '.join(paths)} are not adjacent numbers"):
        CdrFrame(Step.Response(message="a text")).writer(paths)


def test_an_unknown_field_is_named_with_a_suggestion():
    frame = CdrFrame(JointState(position=(1.0,)))
    with pytest.raises(UnknownName, match="unknown field 'postion', did you mean 'position'"):
        frame.view("postion")
    with pytest.raises(UnknownName, match=r"unknown stamp 'stamp'; known: header\.stamp"):
        frame.set_stamp("stamp", 0)


def test_text_and_mixed_structs_are_no_numbers():
    with pytest.raises(TypeError, match="'data' contains string; a view needs numbers of one type"):
        CdrFrame(String(data="x")).view("data")
    with pytest.raises(TypeError, match=r"'header\.stamp' contains int32 and uint32"):
        CdrFrame(JointState()).view("header.stamp")


def test_a_stamp_that_does_not_fit_is_refused():
    frame = CdrFrame(JointState())
    with pytest.raises(struct.error):
        frame.set_stamp("header.stamp", 2**31 * 10**9)


@pytest.mark.parametrize("encoding", ["rgb8", "mono16", "32FC1"])
def test_the_pixels_of_an_image_are_written_in_place(encoding):
    like = Image(header=Header(frame_id="eye"), height=4, width=6, encoding=encoding, step=18, data=bytes(72))
    frame = CdrFrame(like)
    pixels = np.arange(72, dtype=np.uint8).reshape(4, 6, 3)
    view = frame.view("data")
    assert (view.dtype, view.shape, view.flags.writeable) == (np.uint8, (72,), True)
    view.reshape(4, 6, 3)[:] = pixels
    frame.view("height")[:] = 2
    assert frame.payload() == like.model_copy(update={"height": 2, "data": pixels.tobytes()}).to_cdr()


@pytest.mark.parametrize("names", ["xyz", "xyzi", ("x", "y", "z", "rgb")])
def test_the_points_of_a_cloud_are_written_in_place(names):
    fields = tuple(PointField(name=name, offset=4 * i, datatype=7, count=1) for i, name in enumerate(names))
    step = 4 * len(names)
    like = PointCloud2(height=1, width=5, fields=fields, point_step=step, row_step=5 * step, data=bytes(5 * step))
    frame = CdrFrame(like)
    points = np.random.default_rng(1).random((5, len(names)), np.float32)
    # The length of a sequence of bytes is a multiple of 4 here, and so is its place: it can be seen as floats.
    frame.view("data").view(np.float32).reshape(5, len(names))[:] = points
    frame.view("is_dense")[:] = True
    frame.set_stamp("header.stamp", 2_000_000_003)
    stamped = Header(stamp=Time(sec=2, nanosec=3))
    expected = like.model_copy(update={"header": stamped, "data": points.tobytes(), "is_dense": True})
    assert frame.payload() == expected.to_cdr()
    assert PointCloud2.from_cdr(frame.payload()) == expected
